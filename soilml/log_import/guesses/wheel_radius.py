"""The table [wheel] of a new map: the radius that a log states, or that its slip implies."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence

import numpy as np

from soilml.log_import.channels.inputs import Inputs, moving, our_slip
from soilml.log_import.channels.resampling import on_grid
from soilml.log_import.channels.runs import Run
from soilml.log_import.guesses.columns import Candidate
from soilml.log_import.guesses.constants import gears_in_names
from soilml.log_import.guesses.draft import (
    Draft,
    Marked,
    fastest_ratio,
    inputs_of,
    key_line,
    toml_value,
)
from soilml.log_import.guesses.roles import Assignment
from soilml.log_import.units import spelling

_OF_GEAR = re.compile(
    r"(?i)(?<![a-z])((?:width|wheel|b|w|lug|grouser|h)[_-]?\d+(?:mm)?)(?![a-z0-9])"
)
_RADII = (0.02, 0.7)  # Radii of wheels, m
#: Slips from which a radius follows; fewest samples; scatter of the radius over it.
_SLIPS, _FEWEST, _SCATTER = (0.0, 0.9), 20, 0.05


def wheel_lines(
    drafts: dict[str, Draft],
    found: Assignment,
    run: Run,
    stated: Mapping[str, tuple[str, str]],
    run_names: Sequence[str] = (),
) -> list[str]:
    """The lines of the table."""
    if several := gears_in_names(run_names):
        return _lines_of_gears(*several)
    lines = ["", "[wheel]", *_gear_lines(run_names)]
    for key in ("radius", "diameter"):
        if key in stated:
            value, line = stated[key]
            number = value if " " in value else f"{value} m"
            why = f"stated in the log: {line[:60]}"
            if "CHANGE" in line:
                why = Marked(f"stated in the {line}")
            return [*lines, key_line(key, f"{number} +- 1 %", why)]
    turning = {"wheel_speed", "wheel_angle"} & found.roles()
    needed = not {"slip", "rim_speed"} & found.roles() and bool(turning)
    inputs = inputs_of(drafts, run) if turning else None
    ratio = fastest_ratio(inputs) if inputs is not None and needed else math.nan
    gear = 1.0
    for role in ("wheel_speed", "wheel_angle"):
        if role in drafts:  # the rotation is that of the motor
            gear *= float(drafts[role].keys.get("gear_ratio", 1.0))
    ratio *= gear
    slips = [*found.others.get("slip", []), *filter(None, [found.shared.get("slip")])]
    if inputs is not None and slips:
        radius = gear * radius_of_slip(inputs, slips[0], run)
        if _RADII[0] < radius < _RADII[1]:
            why = f"v / (omega (1 - slip)) with the slip of the column {slips[0].address!r}"
            return [*lines, key_line("radius", f"{radius:.3g} m +- 1 %", why)]
    hint = ""
    if math.isfinite(ratio) and ratio > 0.0:
        if _RADII[0] < ratio < _RADII[1]:
            hint = f"; travel over rotation is {ratio:.3g} m at the lowest slip: a little less"
        else:
            hint = (
                f"; travel over rotation is {ratio:.3g} m: a unit is wrong, or the rotation is "
                "measured before a gearbox"
            )
    example = '# radius = "0.15 m +- 1 %"'
    if needed:
        return [*lines, Marked(f"{example}  # NEEDED{hint}")]
    return [*lines, f"{example}  # for checks{hint}"]


def _lines_of_gears(pattern: str, gears: Mapping[str, tuple[str, str]]) -> list[str]:
    """The tables where names of runs say wheels of different radius."""
    why = f"the names say {', '.join(list(gears)[:4])}; [gears.NAME] of the model file"
    lines = ["", "[wheel]", key_line("gear_from", pattern, why)]
    for name, (key, value) in gears.items():
        written = name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else toml_value(name)
        lines += ["", f"[gears.{written}]"]
        lines.append(key_line(key, f"{value} +- 1 %", "by the names"))
    return lines


def _gear_lines(run_names: Sequence[str]) -> list[str]:
    """A line on the gear where names of runs have several widths or numbers of a wheel."""
    matches = [_OF_GEAR.search(name) for name in run_names]
    gears = dict.fromkeys(match[1] for match in matches if match)
    if len(gears) < 2 or not all(matches):
        return []
    shown = ", ".join(list(gears)[:4])
    why = f"the names say {shown}; where these are wheels: [gears.NAME] of the model file"
    return ["# " + key_line("gear_from", _OF_GEAR.pattern, why)]


def radius_of_slip(inputs: Inputs, slip: Candidate, run: Run) -> float:
    r"""Radius in m at which a logged slip is that of rotation and travel; NaN where none is.

    .. math:: r = v / (\omega (1 - s))
    """
    rotation, ground = inputs.values.get("wheel_speed"), inputs.values.get("ground_speed")
    if rotation is None or ground is None:
        return math.nan
    own = on_grid(inputs.time, *run.find(slip.address))
    percent = spelling(slip.unit) == "percent" or slip.about.size > 1.5
    scale = 0.01 if percent else 1.0
    own = our_slip(scale * own, "1 - v/(r omega)")
    driven = moving(inputs) & (own > _SLIPS[0]) & (own < _SLIPS[1]) & (np.abs(rotation) > 0.0)
    if driven.sum() < _FEWEST:
        return math.nan
    radii = np.abs(ground[driven] / rotation[driven]) / (1.0 - own[driven])
    radii = radii[np.isfinite(radii)]
    if radii.size < _FEWEST:
        return math.nan
    middle = float(np.median(radii))
    spread = float(np.median(np.abs(radii - middle)))
    return middle if spread < _SCATTER * middle else math.nan
