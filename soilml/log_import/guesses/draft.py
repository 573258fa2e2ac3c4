"""The table of one channel in a guess: samples as it reads them, its sign and its zero."""

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
from soilml.log_import.channels.runs import Run
from soilml.log_import.checks.sensors import offset_at_rest
from soilml.log_import.guesses.columns import Candidate
from soilml.log_import.guesses.role_words import USUAL, says
from soilml.log_import.mapping.channel_map import ChannelMap, Uncertain
from soilml.log_import.mapping.log_map import WheelMap
from soilml.log_import.mapping.written_map import Marked, WrittenTable

BY_NAME = "by its name"  # Why a unit is known that no brackets state, as of ticks and rpm
#: A sensor that reads more than this, m, has its zero elsewhere; how far a wheel sinks at rest, m.
_FAR, _SUNK = 0.08, 0.01
#: Share of the radius that no wheel sinks in at rest; what is more than noise of a reading, m.
_MOST_AT_REST, _NOISE = 0.3, 0.002
_FEWEST = 6  # Fewest means that tell a correlation


@dataclass
class Draft(WrittenTable):
    """The table of one channel, the column that it is guessed to be, and what speaks for it."""

    column: Candidate = field(kw_only=True)
    role: str = field(kw_only=True)
    word: bool = False  # Whether a full word of the role is in the name
    rival: str = ""  # A column of other values whose name says as much; "" for none
    second: str = ""  # The column that would be the next one; "" for none
    physics: str = ""  # What other channels say for it and against it
    against: str = ""

    @property
    def is_silent(self) -> bool:
        """Whether the channel needs no mark: the one rule."""
        proved = bool((self.stated_unit and self.word) or self.physics)
        return proved and not (self.against or self.rival)

    @property
    def mark(self) -> str:
        """What the mark says, and which column might be meant otherwise."""
        lacks = {"its name alone does not say so": self.word,
                 "no unit is stated": self.stated_unit}  # fmt: skip
        why = self.against or ", and ".join(text for text, there in lacks.items() if not there)
        if not why:
            return f"CHANGE: {self.rival!r} fits as well"
        return f"CHANGE: {why}" + (f"; else perhaps {self.second!r}" if self.second else "")

    @property
    def evidence(self) -> str:
        """What speaks for the column, as lines of text."""
        return (
            f"[{self.role}] {self.column.address}: {'no mark' if self.is_silent else self.mark}\n"
            f"    unit {self.stated_unit or 'not stated'}; "
            f"{'a' if self.word else 'no'} full word of the role in the name; "
            f"physics: {self.against or self.physics or 'nothing confirms it'}\n"
        )

    @property
    def stated_unit(self) -> str:
        """The unit that the log states, or that the name says; "" where it was guessed."""
        if self.comments.get("unit") == BY_NAME:
            return str(self.keys["unit"])
        return self.column.unit if self.column.kind not in (None, "other") else ""

    @property
    def gear_ratio(self) -> float:
        """Turns of the sensor's shaft for one of the wheel."""
        return float(self.keys.get("gear_ratio", 1.0))

    def only(self, path: str, keys: Sequence[str]) -> Draft:
        """The draft as a table of another path, with some of its keys."""
        kept = {key: value for key, value in self.keys.items() if key in keys}
        after = self.after if "column" in kept else []
        return Draft(path, kept, self.comments, after=after, column=self.column, role=self.role)


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
    """Travel (m/s) over rotation (rad/s, or rim speed), without sign (n,); empty for none."""
    rotation = means.get("rim_speed", means.get("wheel_speed"))
    if rotation is None or "ground_speed" not in means:
        return np.zeros(0)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.abs(means["ground_speed"] / rotation)
    return np.asarray(ratio[np.isfinite(ratio)])


def implied_radius(drafts: Mapping[str, Draft], means: Mapping[str, Floats]) -> float:
    """The largest travel over rotation, m, 95th percentile; NaN where a channel is missing."""
    turning = next((role for role in ("wheel_angle", "wheel_speed") if role in drafts), "")
    ratio = travel_over_rotation(means)
    if ratio.size < 2 or not turning:
        return math.nan
    return drafts[turning].gear_ratio * float(np.percentile(ratio, 95))


def correlation(means: Mapping[str, Floats], one: str, other: str) -> float:
    """Correlation of two channels; 0 where too few means tell it."""
    if not {one, other} <= means.keys():
        return 0.0
    both = np.stack([means[one], means[other]])
    both = both[:, np.isfinite(both).all(axis=0)]
    if both.shape[1] < _FEWEST or not np.ptp(both, axis=1).all():
        return 0.0
    return float(np.corrcoef(*both)[0, 1])


def put_signs(drafts: dict[str, Draft], inputs: Inputs) -> None:
    """Turn channels that are against the rotation, so that all that drives is positive.

    Also a slip that is below zero where the torque drives, as of logs that count braking up, and a
    pull that falls where the torque, or the current of the motor, rises.
    """
    driven, values = moving(inputs), inputs.values
    rotation = next((r for r in ("rim_speed", "wheel_speed") if r in values), "")
    turning = next((r for r in ("wheel_angle", "rim_speed", "wheel_speed") if r in drafts), "")
    for key, roles in ((rotation, (turning,)), ("ground_speed", ("ground_speed", "position"))):
        if key in values and np.nanmedian(values[key][driven]) < 0.0:
            for role in {*roles} & drafts.keys():
                drafts[role].put("reverse", True, "it is negative in the log; forward is positive")
    for role, draft in drafts.items():
        if role not in values or not (why := USUAL[role].positive):
            continue
        driving = float(np.nanmedian(values[role][driven]))
        if USUAL[role].zero:
            driving -= np.nan_to_num(inputs.rest.get(role, (0.0, 0.0))[0])
        if driving < -0.5 * float(np.nanstd(values[role][driven])):
            draft.put("reverse", True, f"it is negative in the log; {why}")

    def sign(role: str) -> float:
        return -1.0 if drafts[role].keys.get("reverse") else 1.0

    if {"slip", "torque"} <= values.keys() & drafts.keys():
        torque, slip = sign("torque") * values["torque"], values["slip"]
        drives = torque > 0.5 * float(np.nanpercentile(np.abs(torque), 90))
        drives &= np.isfinite(slip) & (slip != 0.0)
        if drives.any() and float(np.mean(slip[drives] < 0.0)) > 0.9:
            drafts["slip"].put("reverse", True, "it is negative in the log where the torque drives")
    means = driving_means(inputs)
    role = "torque" if "torque" in means else "motor_current"
    if role in drafts and sign(role) * correlation(means, role, "drawbar_pull") < -0.8:
        drafts["drawbar_pull"].put("reverse", True, "it falls in the log where the torque rises")


def put_tares(drafts: dict[str, Draft], inputs: Inputs) -> None:
    """Tare what reads something before the wheel starts and should read zero there."""
    for role, draft in drafts.items():
        if USUAL[role].zero and (offset := offset_at_rest(inputs, role)):
            why = "before the wheel starts; remove this line where that is real"
            draft.put("tare", "rest", f"it reads {offset:.3g} {why}")


def put_zero_of_sinkage(drafts: dict[str, Draft], inputs: Inputs, radius: float) -> None:
    """Tare a sinkage that is the distance of a sensor to the ground, or a place on a scale.

    That is one that is far, or a large share of the `radius` (m, 0 where unknown), or that falls as
    the wheel drives. Where it might be, a comment says so; of a wheel that never rests, a mark.
    """
    rest = inputs.rest.get("sinkage", (math.nan, 0.0))[0]
    if "sinkage" not in drafts or "sinkage" not in inputs.values:
        return
    draft, shown = drafts["sinkage"], f"it reads {1e3 * abs(rest):.3g} mm"
    level = float(np.nanmedian(inputs.values["sinkage"][moving(inputs)]))
    far = min(_FAR, _MOST_AT_REST * radius) if radius > 0.0 else _FAR
    if not math.isfinite(rest):
        falls = correlation(driving_means(inputs), "sinkage", "torque") < -0.5
        if says(draft.column.name, "heights") or abs(level) > far or falls:
            draft.comments["column"] = Marked(
                f"CHANGE: it reads {1e3 * level:.3g} mm as the wheel drives, and no rest shows "
                "where the surface is; a distance to it falls as the wheel sinks (reverse = true)"
            )
        return
    falls = abs(level) < abs(rest) - _NOISE
    if abs(rest) < far and abs(level) < _FAR and not falls:
        add = 'add tare = "rest" and bias = 0.01'
        if says(draft.column.name, "heights") and not abs(rest) > _NOISE:
            draft.comments["column"] = Marked(
                "CHANGE: a height is a sinkage where its zero is the undisturbed surface; else "
                f"{add}"
            )
        elif abs(rest) > _NOISE and (rest < 0.0) == draft.keys.get("reverse", False):
            draft.comments["column"] = (
                f"{shown} before the wheel starts; where that is the zero of the sensor, and no "
                f"sinkage, {add}"
            )
        return
    if level < rest:
        draft.put("reverse", True, "it falls as the wheel sinks in")
    else:
        draft.keys.pop("reverse", None)
    draft.put("tare", "rest", f"{shown} there; sinkage counts from where the wheel rests")
    why = "CHANGE: m, by how much the wheel may have sunk in before it started"
    draft.put("bias", _SUNK, Marked(why))
