"""A draft of a map: content with the reasons for it, checked on the samples of the first runs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.errors import SoilmlError
from soilml.log_import.channels.inputs import Inputs, resting, wheel_inputs
from soilml.log_import.channels.runs import Run
from soilml.log_import.guesses.candidates import Candidate
from soilml.log_import.guesses.unit_guess import guess_rotation_unit, guess_unit
from soilml.log_import.mapping.channel import take_channel
from soilml.log_import.mapping.log_map import WheelMap
from soilml.log_import.recording import Floats
from soilml.log_import.units.conversion import dimension
from soilml.log_import.units.uncertain_value import Uncertain

#: Share of the reading while driving from which a reading at rest is an offset.
_OFFSET = 0.01
#: Roles that read zero while a wheel rests.
ZERO_AT_REST = ("torque", "motor_current", "drawbar_pull")


@dataclass
class Draft:
    """The table of one channel: its keys, and a comment for each of them."""

    keys: dict[str, Any] = field(default_factory=dict)
    comments: dict[str, str] = field(default_factory=dict)
    column: Candidate | None = None

    def put(self, key: str, value: Any, why: str = "") -> None:
        """Set a key and its comment."""
        self.keys[key] = value
        if why:
            self.comments[key] = why

    def without(self, shared: Draft) -> Draft:
        """The keys that are not in another draft."""
        return Draft({k: v for k, v in self.keys.items() if k not in shared.keys}, self.comments)


def keys_alike(wheels: Sequence[dict[str, Draft]]) -> dict[str, Draft]:
    """The keys that all wheels share, by role, with the comments of the first wheel."""
    return {
        role: Draft(
            {
                key: value
                for key, value in first.keys.items()
                if all(key in w[role].keys and w[role].keys[key] == value for w in wheels)
            },
            first.comments,
        )
        for role, first in (wheels[0] if wheels else {}).items()
    }


def draft_channels(
    chosen: dict[str, Candidate],
    run: Run,
    stated: dict[str, tuple[str, str]],
    axes: Sequence[Candidate] = (),
) -> dict[str, Draft]:
    """Tables of the channels of one wheel, with units, signs and tares as the samples show them.

    `axes` are the columns of y and z, where the chosen place is x.
    """
    drafts = {
        role: _draft(role, column, run, stated, axes if role == "position" else ())
        for role, column in chosen.items()
    }
    _rotation_unit(drafts, stated)
    inputs = inputs_of(drafts, run)
    if inputs is not None:
        _signs(drafts, inputs)
        _sign_of_pull(drafts, inputs)
        _tares(drafts, inputs)
        _lifted(drafts, inputs)
    return drafts


def _draft(
    role: str,
    column: Candidate,
    run: Run,
    stated: dict[str, tuple[str, str]],
    axes: Sequence[Candidate],
) -> Draft:
    draft = Draft(column=column)
    draft.put("column", [c.address for c in (column, *axes)] if axes else column.address)
    _, values = run.find(column.address)
    known = values[np.isfinite(values)]
    moving = float(np.percentile(np.abs(known), 90)) if known.size else 0.0
    if role in ("position", "wheel_angle", "sinkage") and known.size:
        moving = max(float(np.nanmax(v) - np.nanmin(v)) for v in
                     (run.find(c.address)[1] for c in (column, *axes)))  # fmt: skip
    unit, why = guess_unit(role, column, moving)
    if dimension(unit) in ("count", "count/s"):
        number = stated.get("counts_per_turn", ("1", ""))[0]
        known_turn = "counts_per_turn" in stated
        draft.put("unit", unit, why)
        draft.put(
            "counts_per_turn",
            float(number) if known_turn else 1.0,
            "stated in the log" if known_turn else "CHANGE: counts for one turn of the encoder",
        )
    else:
        draft.put("unit", unit, why)
    if role == "wheel_angle" and column.about.wraps_at:
        draft.put("wraps_at", column.about.wraps_at, "it starts again there")
    if role in ("wheel_angle", "wheel_speed", "motor_current"):
        ratio = stated.get("gear_ratio")
        if ratio is not None and _is_motor(column, role):
            draft.put("gear_ratio", float(ratio[0].split()[0]), f"stated in the log: {ratio[1]}")
        else:
            why = "turns of the motor for one of the wheel; 1 where measured at the wheel"
            if role == "motor_current" or "mot" in column.address.lower():
                why = "CHANGE: turns of the motor for one of the wheel"
            draft.put("gear_ratio", 1.0, why)
    if role == "motor_current":
        constant = stated.get("torque_constant")
        if constant is not None:
            draft.put("torque_constant", f"{constant[0]} +- 5 %", f"stated: {constant[1]}")
        else:
            draft.put(
                "torque_constant", "1.0 N m/A +- 5 %", "CHANGE: from the data sheet of the motor"
            )
        efficiency = stated.get("efficiency", ("0.7", ""))[0]
        why = "of the gearbox" if "efficiency" in stated else "CHANGE: of the gearbox"
        draft.put("efficiency", f"{efficiency} +- 0.05", why)
        draft.put("idle_current", "0 A +- 0.02 A", "what the lifted wheel takes at this speed")
    return draft


def _is_motor(column: Candidate, role: str) -> bool:
    words = column.address.lower()
    return role == "motor_current" or "mot" in words or "enc" in words


def _rotation_unit(drafts: dict[str, Draft], stated: dict[str, tuple[str, str]]) -> None:
    """Find the unit of a rotation rate that states none beside the travel speed."""
    rotation, ground = drafts.get("wheel_speed"), drafts.get("ground_speed")
    if rotation is None or rotation.column is None or rotation.keys["unit"] != "rad/s":
        return
    if rotation.column.unit or ground is None or ground.column is None:
        return
    factor = {"mm/s": 1e-3, "cm/s": 1e-2}.get(ground.keys["unit"], 1.0)
    radius = 0.0
    if "radius" in stated:
        text = stated["radius"][0].split()
        radius = float(text[0]) * (1e-3 if "mm" in text else 1.0)
    unit, why = guess_rotation_unit(
        rotation.column.about.size, factor * ground.column.about.size, radius
    )
    rotation.put("unit", unit, why)


def wheel_of(drafts: dict[str, Draft]) -> WheelMap:
    """The channels of a draft as a wheel with a radius of 1 m; raises `InputError`."""
    from pathlib import Path

    from soilml.io.toml_settings import Settings

    channels = {
        role: take_channel(Settings(dict(draft.keys), f"draft [{role}]", Path()), role)
        for role, draft in drafts.items()
    }
    return WheelMap("", Uncertain(1.0), channels)


def inputs_of(drafts: dict[str, Draft], run: Run) -> Inputs | None:
    """The samples as a draft reads them; None where it does not fit the run."""
    try:
        return wheel_inputs(run, wheel_of(drafts))
    except SoilmlError:
        return None


def _moving(inputs: Inputs) -> NDArray[np.bool_]:
    speed = inputs.values.get("wheel_speed", inputs.values.get("rim_speed"))
    if speed is None:
        speed = inputs.values.get("ground_speed")
    if speed is None:
        return np.ones(inputs.time.size, dtype=bool)
    size: Floats = np.abs(np.nan_to_num(speed))
    return np.asarray(size > 0.3 * np.percentile(size, 90))


def _signs(drafts: dict[str, Draft], inputs: Inputs) -> None:
    """Turn channels that are against the rotation, so that all that drives is positive."""
    moving = _moving(inputs)
    rotation = next((r for r in ("rim_speed", "wheel_speed") if r in inputs.values), None)
    sign = 1.0
    if rotation is not None:
        sign = math.copysign(1.0, float(np.nanmedian(inputs.values[rotation][moving])))
        source = next(r for r in ("wheel_angle", "rim_speed", "wheel_speed") if r in drafts)
        if sign < 0.0:
            drafts[source].put("reverse", True, "it is negative in the log; forward is positive")
    for role, key in (("ground_speed", "ground_speed"), ("position", "ground_speed")):
        if role in drafts and key in inputs.values:
            middle = float(np.nanmedian(inputs.values[key][moving]))
            if middle < 0.0:
                drafts[role].put("reverse", True, "it is negative in the log; forward is positive")
    for role in ("torque", "motor_current", "load", "sinkage"):
        if role not in inputs.values or role not in drafts:
            continue
        values = inputs.values[role]
        driving = float(np.nanmedian(values[moving]))
        if role not in ("load", "sinkage"):
            driving -= np.nan_to_num(inputs.rest.get(role, (0.0, 0.0))[0])
        scatter = float(np.nanstd(values[moving]))
        if driving < -0.5 * scatter:
            why = {"load": "a load is positive", "sinkage": "sinkage is positive"}.get(
                role, "positive where it drives forward"
            )
            drafts[role].put("reverse", True, f"it is negative in the log; {why}")


def _sign_of_pull(drafts: dict[str, Draft], inputs: Inputs) -> None:
    """Turn a pull that falls where the torque rises."""
    if not {"torque", "drawbar_pull"} <= drafts.keys() & inputs.values.keys():
        return
    torque, pull = inputs.values["torque"], inputs.values["drawbar_pull"]
    kept = np.flatnonzero(_moving(inputs) & np.isfinite(torque) & np.isfinite(pull))
    width = max(1, round(1.0 / inputs.step))
    count = kept.size // width
    if count < 6:
        return
    blocks = kept[: count * width].reshape(count, width)
    means = np.stack([torque[blocks].mean(axis=1), pull[blocks].mean(axis=1)])
    if np.ptp(means, axis=1).min() > 0.0:
        sign = -1.0 if drafts["torque"].keys.get("reverse") else 1.0
        if sign * float(np.corrcoef(means)[0, 1]) < -0.8:
            why = "it falls in the log where the torque rises"
            drafts["drawbar_pull"].put("reverse", True, why)


def _tares(drafts: dict[str, Draft], inputs: Inputs) -> None:
    """Tare what reads something before the wheel starts and should read zero there."""
    moving = _moving(inputs)
    for role in ZERO_AT_REST:
        if role not in drafts or role not in inputs.rest or role not in inputs.values:
            continue
        mean, error = inputs.rest[role]
        level = abs(float(np.nanmedian(inputs.values[role][moving])) - mean)
        if not abs(mean) > 3.0 * np.nan_to_num(error) or level == 0.0:
            continue
        if abs(mean) > _OFFSET * level and (role != "motor_current" or abs(mean) < level):
            drafts[role].put(
                "tare", "rest", f"it reads {mean:.3g} before the wheel starts; remove this line "
                "where that is real"
            )  # fmt: skip


def _lifted(drafts: dict[str, Draft], inputs: Inputs) -> None:
    """Tare a load where the log starts with the wheel above the ground and reads an offset."""
    rest = resting(inputs)
    if rest is None or "load" not in inputs.values or "load" not in drafts:
        return
    values, shortest = inputs.values["load"][rest], round(0.4 / inputs.step)
    driving = float(np.nanmedian(inputs.values["load"][_moving(inputs)]))
    first = float(np.nanmedian(values[:shortest])) if values.size >= shortest > 0 else math.nan
    if not _OFFSET * abs(driving) < abs(first) < 0.6 * abs(driving):
        return
    landed = np.abs(values - first) > 0.25 * abs(driving - first)
    end = int(np.argmax(landed)) if landed.any() else values.size
    if end < shortest:
        return
    start, stop = float(inputs.time[0]), float(inputs.time[0] + 0.8 * end * inputs.step)
    drafts["load"].put(
        "tare", [round(start, 2), round(stop, 2)], f"CHANGE: from, until, s; it reads {first:.3g} "
        f"there and {driving:.3g} while driving: right if the wheel was above the ground"
    )  # fmt: skip


def fastest_ratio(inputs: Inputs) -> float:
    """Largest ratio of travel (m/s) to rotation (rad/s, or rim speed), of means over a second."""
    rotation = inputs.values.get("rim_speed", inputs.values.get("wheel_speed"))
    ground = inputs.values.get("ground_speed")
    if rotation is None or ground is None:
        return float("nan")
    moving = _moving(inputs) & np.isfinite(rotation) & np.isfinite(ground)
    width = max(1, round(2.0 / inputs.step))
    kept = np.flatnonzero(moving)
    count = kept.size // width
    if count < 2:
        return float("nan")
    blocks = kept[: count * width].reshape(count, width)
    ratios = np.abs(ground[blocks].mean(axis=1)) / np.abs(rotation[blocks].mean(axis=1))
    return float(np.percentile(ratios, 95))
