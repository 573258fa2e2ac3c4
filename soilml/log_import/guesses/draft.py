"""The table of one channel in a guess: samples as it reads them, its sign and its tare."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from soilml.arrays import Floats
from soilml.errors import SoilmlError
from soilml.io.declared_settings import take_declared
from soilml.io.toml_settings import Settings
from soilml.log_import.channels.inputs import Inputs, combined, moving, resting, wheel_inputs
from soilml.log_import.channels.resampling import on_grid
from soilml.log_import.channels.runs import Run
from soilml.log_import.guesses.columns import Candidate, says, words_of
from soilml.log_import.mapping.channel_map import ChannelMap, Uncertain
from soilml.log_import.mapping.log_map import WheelMap
from soilml.log_import.mapping.written_map import Marked, WrittenTable
from soilml.log_import.units import spelling

#: Slips from which a radius follows; fewest samples; scatter of the radius over it.
_SLIPS, _FEWEST, _SCATTER = (0.0, 0.9), 20, 0.05
_OFFSET = 0.01  # Share of the reading while driving from which a reading at rest is an offset
#: A sensor that reads more than this, m, has its zero elsewhere; how far a wheel sinks at rest, m.
_FAR, _SUNK = 0.08, 0.01
#: Share of the radius that no wheel sinks in at rest; fall of a reading, and reading at rest, m,
#: that are more than noise.
_MOST_AT_REST, _FALLS, _STANDS = 0.3, 0.002, 0.002
#: Words of places, whose zero may be anywhere.
_HEIGHTS = words_of(
    "height position pos laser distance level elevation hoehe höhe abstand weg altura hauteur"
    " altezza lvdt"
)
#: Roles that are positive where the wheel drives forward, and why.
_POSITIVE = {
    "torque": "positive where it drives forward",
    "motor_current": "positive where it drives forward",
    "load": "a load is positive",
    "sinkage": "sinkage is positive",
}


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


def implied_radius(drafts: Mapping[str, Draft], means: Mapping[str, Floats]) -> float:
    """The largest travel over rotation, m, 95th percentile; NaN where a channel is missing."""
    turning = next((role for role in ("wheel_angle", "wheel_speed") if role in drafts), "")
    ratio = travel_over_rotation(means)
    ratio = ratio[np.isfinite(ratio)]
    if ratio.size < 2 or not turning:
        return math.nan
    return float(drafts[turning].keys.get("gear_ratio", 1.0)) * float(np.percentile(ratio, 95))


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


def signs(drafts: dict[str, Draft], inputs: Inputs) -> None:
    """Turn channels that are against the rotation, so that all that drives is positive.

    Also a slip that is below zero where the torque drives, as of logs that count braking up, and a
    pull that falls where the torque, or the current of the motor, rises.
    """
    driven, values = moving(inputs), inputs.values

    def turn(role: str, why: str) -> None:
        drafts[role].put("reverse", True, why)

    rotation = next((r for r in ("rim_speed", "wheel_speed") if r in values), None)
    turning = next((r for r in ("wheel_angle", "rim_speed", "wheel_speed") if r in drafts), "")
    for key, roles in ((rotation, (turning,)), ("ground_speed", ("ground_speed", "position"))):
        if key in values and np.nanmedian(values[key][driven]) < 0.0:
            for role in {*roles} & drafts.keys():
                turn(role, "it is negative in the log; forward is positive")
    for role, why in _POSITIVE.items():
        if role not in values or role not in drafts:
            continue
        driving = float(np.nanmedian(values[role][driven]))
        if role not in ("load", "sinkage"):
            driving -= np.nan_to_num(inputs.rest.get(role, (0.0, 0.0))[0])
        if driving < -0.5 * float(np.nanstd(values[role][driven])):
            turn(role, f"it is negative in the log; {why}")
    if {"slip", "torque"} <= values.keys() and "torque" in drafts:
        torque, slip = values["torque"], values["slip"]
        sign = -1.0 if drafts["torque"].keys.get("reverse") else 1.0
        size = float(np.nanpercentile(np.abs(torque), 90))
        drives = (sign * torque > 0.5 * size) & np.isfinite(slip) & (slip != 0.0)
        if drives.any() and float(np.mean(slip[drives] < 0.0)) > 0.9:
            turn("slip", "it is negative in the log where the torque drives")
    known = driving_means(inputs)
    role = "torque" if "torque" in known else "motor_current"
    if {role, "drawbar_pull"} <= known.keys() & drafts.keys():
        means = np.stack([known[role], known["drawbar_pull"]])
        means = means[:, np.isfinite(means).all(axis=0)]
        sign = -1.0 if drafts[role].keys.get("reverse") else 1.0
        varies = means.shape[1] >= 6 and np.ptp(means, axis=1).min() > 0.0
        if varies and sign * float(np.corrcoef(*means)[0, 1]) < -0.8:
            turn("drawbar_pull", "it falls in the log where the torque rises")


def tares(drafts: dict[str, Draft], inputs: Inputs) -> None:
    """Tare what reads something before the wheel starts and should read zero there."""
    driven = moving(inputs)
    for role in ("torque", "motor_current", "drawbar_pull"):
        if role not in drafts or role not in inputs.rest or role not in inputs.values:
            continue
        mean, error = inputs.rest[role]
        level = abs(float(np.nanmedian(inputs.values[role][driven])) - mean)
        if not abs(mean) > 3.0 * np.nan_to_num(error) or level == 0.0:
            continue
        if abs(mean) > _OFFSET * level and (role != "motor_current" or abs(mean) < level):
            drafts[role].put(
                "tare", "rest", f"it reads {mean:.3g} before the wheel starts; remove this line "
                "where that is real"
            )  # fmt: skip


def far_sinkage(drafts: dict[str, Draft], inputs: Inputs, radius: float = 0.0) -> None:
    """Tare a sinkage that is the distance of a sensor to the ground, or a place on a scale.

    That is one that is far, or a large share of the `radius` (m, 0 where unknown), or that falls as
    the wheel drives. Where it might be, a comment says so.
    """
    if "sinkage" not in drafts or "sinkage" not in inputs.values or "sinkage" not in inputs.rest:
        return
    rest, draft = inputs.rest["sinkage"][0], drafts["sinkage"]
    level = float(np.nanmedian(inputs.values["sinkage"][moving(inputs)]))
    if not math.isfinite(rest):
        return
    far = min(_FAR, _MOST_AT_REST * radius) if radius > 0.0 else _FAR
    falls = abs(level) < abs(rest) - _FALLS
    if abs(rest) < far and abs(level) < _FAR and not falls:
        if says(draft.column.name, _HEIGHTS) and not abs(rest) > _STANDS:
            draft.comments["column"] = Marked(
                "CHANGE: a height is a sinkage where its zero is the undisturbed surface; else add "
                'tare = "rest" and bias = 0.01'
            )
        elif abs(rest) > _STANDS and (rest < 0.0) == draft.keys.get("reverse", False):
            draft.comments["column"] = (
                f"it reads {1e3 * abs(rest):.3g} mm before the wheel starts; where that is "
                'the zero of the sensor, and no sinkage, add tare = "rest" and bias = 0.01'
            )
        return
    if level < rest:
        draft.put("reverse", True, "it falls as the wheel sinks in")
    else:
        draft.keys.pop("reverse", None)
    why = "sinkage counts from where the wheel rests"
    draft.put("tare", "rest", f"it reads {1e3 * abs(rest):.3g} mm there; {why}")
    why = "CHANGE: m, by how much the wheel may have sunk in before it started"
    draft.put("bias", _SUNK, Marked(why))


def lifted(drafts: dict[str, Draft], inputs: Inputs) -> None:
    """Where the log starts with the wheel above the ground: tare a load there with an offset."""
    rest = resting(inputs)
    if rest is None or "load" not in inputs.values or "load" not in drafts:
        return
    values, shortest = inputs.values["load"][rest], round(0.4 / inputs.step)
    driving = float(np.nanmedian(inputs.values["load"][moving(inputs)]))
    first = float(np.nanmedian(values[:shortest])) if values.size >= shortest > 0 else math.nan
    if not _OFFSET < abs(first) / max(abs(driving), 1e-300) < 0.6:
        return
    landed = np.flatnonzero(np.abs(values - first) > 0.25 * abs(driving - first))
    end = int(landed[0]) if landed.size else values.size
    if end >= shortest:
        start = float(inputs.time[0])
        why = (
            f"CHANGE: from, until, s; it reads {first:.3g} there and {driving:.3g} while driving: "
            "right if the wheel was above the ground"
        )
        stretch = [round(start, 2), round(start + 0.8 * end * inputs.step, 2)]
        drafts["load"].put("tare", stretch, Marked(why))
