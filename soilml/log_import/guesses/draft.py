"""The table of one channel in a guess, and the samples of a run as guesses read them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from soilml.arrays import Floats
from soilml.errors import SoilmlError
from soilml.io.declared_settings import take_declared
from soilml.io.toml_settings import Settings
from soilml.log_import.channels.inputs import Inputs, combined, moving, wheel_inputs
from soilml.log_import.channels.resampling import on_grid
from soilml.log_import.channels.runs import Run
from soilml.log_import.guesses.columns import Candidate
from soilml.log_import.mapping.channel_map import ChannelMap, Uncertain
from soilml.log_import.mapping.log_map import WheelMap
from soilml.log_import.mapping.written_map import WrittenTable
from soilml.log_import.units import spelling

#: Slips from which a radius follows; fewest samples; scatter of the radius over it.
_SLIPS, _FEWEST, _SCATTER = (0.0, 0.9), 20, 0.05


@dataclass
class Draft(WrittenTable):
    """The table of one channel, and the column that it is guessed to be."""

    column: Candidate = field(kw_only=True)

    def only(self, path: str, keys: Sequence[str]) -> Draft:
        """The draft as a table of another path, with some of its keys."""
        kept = {key: value for key, value in self.keys.items() if key in keys}
        after = self.after if "column" in kept else []
        return Draft(path, kept, self.comments, after=after, column=self.column)


def wheel_of(drafts: Mapping[str, Draft], radius: float | None) -> WheelMap:
    """The wheel of drafts; raises `InputError` for keys that do not go together."""
    tables = {role: Settings(dict(draft.keys), f"[{role}]") for role, draft in drafts.items()}
    channels = {r: take_declared(ChannelMap, own, r, role=r) for r, own in tables.items()}
    return WheelMap("", None if radius is None else Uncertain(radius), channels)


def inputs_of(drafts: Mapping[str, Draft], run: Run, steady: bool) -> Inputs | None:
    """The samples as drafts read them; None where these do not fit the run.

    Of a table whose rows are `steady` runs, each row is a sample.
    """
    try:
        wheel = wheel_of(drafts, 1.0)
        if not steady:
            return wheel_inputs(run, wheel)
        time: Floats = np.arange(max(2.0, len(run.recordings[0])))
        columns = {r: [run.find(a)[1] for a in c.columns] for r, c in wheel.channels.items()}
        values = {r: combined(wheel.channels[r], own) for r, own in columns.items()}
        return Inputs(time, values) if len(run.recordings[0]) > 1 else None
    except SoilmlError:
        return None


def driving_means(inputs: Inputs, seconds: float = 1.0) -> dict[str, Floats]:
    """Means (blocks,) of the channels over some seconds of driving, of a short log over less."""
    kept = np.flatnonzero(moving(inputs))
    width = max(1, min(round(seconds / inputs.step), kept.size // 60))
    blocks = kept[: kept.size // width * width].reshape(-1, width)
    means = {role: own[blocks].mean(axis=1) for role, own in inputs.values.items()}
    return {role: own for role, own in means.items() if np.isfinite(own).any()}


def travel_over_rotation(means: Mapping[str, Floats]) -> Floats:
    """Travel (m/s) over rotation (rad/s, or rim speed), without sign (blocks,); empty for none."""
    rotation = means.get("rim_speed", means.get("wheel_speed"))
    if rotation is None or "ground_speed" not in means:
        return np.zeros(0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.abs(means["ground_speed"] / rotation))


def fastest_ratio(inputs: Inputs) -> float:
    """Largest ratio of travel to rotation, of means over two seconds; NaN where there are few."""
    ratio = travel_over_rotation(driving_means(inputs, 2.0))
    ratio = ratio[np.isfinite(ratio)]
    return float(np.percentile(ratio, 95)) if ratio.size > 1 else float("nan")


def radius_of_slip(inputs: Inputs, slip: Candidate, run: Run) -> tuple[float, float]:
    r"""Radius in m at which a logged slip is that of rotation and travel, and its scatter over it.

    .. math:: r = v / (\omega (1 - s))

    A slip that was computed from both has next to no scatter, one that was set has theirs. NaN
    where there is no such radius.
    """
    rotation, ground = inputs.values.get("wheel_speed"), inputs.values.get("ground_speed")
    if rotation is None or ground is None:
        return math.nan, math.nan
    percent = spelling(slip.unit) == "percent" or slip.about.size > 1.5
    own = (0.01 if percent else 1.0) * on_grid(inputs.time, *run.find(slip.address))
    driven = moving(inputs) & (own > _SLIPS[0]) & (own < _SLIPS[1]) & (np.abs(rotation) > 0.0)
    radii = np.abs(ground[driven] / rotation[driven]) / (1.0 - own[driven])
    radii = radii[np.isfinite(radii)]
    if radii.size < _FEWEST:
        return math.nan, math.nan
    middle = float(np.median(radii))
    spread = float(np.median(np.abs(radii - middle)))
    return (middle, spread / middle) if spread < _SCATTER * middle else (math.nan, math.nan)
