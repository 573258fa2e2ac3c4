"""Channels of a draft that read something where they should read zero."""

from __future__ import annotations

import math

import numpy as np

from soilml.log_import.channels.inputs import Inputs, resting
from soilml.log_import.guesses.columns.column_words import words_of
from soilml.log_import.guesses.drafts.draft import Draft
from soilml.log_import.guesses.drafts.draft_inputs import moving

#: Share of the reading while driving from which a reading at rest is an offset.
_OFFSET = 0.01
#: A sensor that reads more than this, m, has its zero elsewhere; how far a wheel sinks at rest, m.
_FAR, _SUNK = 0.08, 0.01
#: Share of the radius that no wheel sinks in at rest; fall of a reading, and reading at rest, m,
#: that are more than noise.
_MOST_AT_REST, _FALLS, _STANDS = 0.3, 0.002, 0.002
#: Words of places, whose zero may be anywhere.
_HEIGHTS = {"height", "position", "pos", "laser", "distance", "level", "elevation", "hoehe", "höhe"}
_HEIGHTS |= {"abstand", "weg", "altura", "hauteur", "altezza", "lvdt"}
#: Roles that read zero while a wheel rests.
ZERO_AT_REST = ("torque", "motor_current", "drawbar_pull")


def tares(drafts: dict[str, Draft], inputs: Inputs) -> None:
    """Tare what reads something before the wheel starts and should read zero there."""
    driven = moving(inputs)
    for role in ZERO_AT_REST:
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
    rest = inputs.rest["sinkage"][0]
    level = float(np.nanmedian(inputs.values["sinkage"][moving(inputs)]))
    if not math.isfinite(rest):
        return
    draft = drafts["sinkage"]
    turned = draft.keys.get("reverse", False)
    far = min(_FAR, _MOST_AT_REST * radius) if radius > 0.0 else _FAR
    falls = abs(level) < abs(rest) - _FALLS
    if abs(rest) < far and abs(level) < _FAR and not falls:
        height = draft.column is not None and _HEIGHTS & {*words_of(draft.column.name)}
        if height and not abs(rest) > _STANDS:
            draft.comments["column"] = (
                "CHANGE: a height is a sinkage where its zero is the undisturbed surface; else add "
                'tare = "rest" and bias = 0.01'
            )
        elif abs(rest) > _STANDS and (rest < 0.0) == turned:
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
    draft.put("bias", _SUNK, "CHANGE: m, by how much the wheel may have sunk in before it started")


def lifted(drafts: dict[str, Draft], inputs: Inputs) -> None:
    """Where the log starts with the wheel above the ground: tare a load there that reads an offset,
    and a sinkage not before the wheel has landed.
    """
    rest = resting(inputs)
    if rest is None or "load" not in inputs.values or "load" not in drafts:
        return
    values, shortest = inputs.values["load"][rest], round(0.4 / inputs.step)
    driving = float(np.nanmedian(inputs.values["load"][moving(inputs)]))
    first = float(np.nanmedian(values[:shortest])) if values.size >= shortest > 0 else math.nan
    if not abs(first) < 0.6 * abs(driving):
        return
    landed = np.abs(values - first) > 0.25 * abs(driving - first)
    end = int(np.argmax(landed)) if landed.any() else values.size
    if end < shortest:
        return
    start, stop = float(inputs.time[0]), float(inputs.time[0] + 0.8 * end * inputs.step)
    if abs(first) > _OFFSET * abs(driving):
        drafts["load"].put(
            "tare", [round(start, 2), round(stop, 2)], f"CHANGE: from, until, s; it reads "
            f"{first:.3g} there and {driving:.3g} while driving: right if the wheel was above the "
            "ground"
        )  # fmt: skip
    on_ground = np.abs(values - first) > 0.9 * abs(driving - first)
    if drafts.get("sinkage", Draft()).keys.get("tare") == "rest" and on_ground.any():
        down = start + int(np.argmax(on_ground)) * inputs.step
        until = start + (values.size - 1) * inputs.step
        if until - down > 0.4:
            drafts["sinkage"].put(
                "tare", [round((down + until) / 2, 2), round(until, 2)],
                "from, until, s: the wheel stands on the ground and does not turn yet",
            )  # fmt: skip
