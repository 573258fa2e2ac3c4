"""Channels of a draft whose sign is turned in the log."""

from __future__ import annotations

import math

import numpy as np

from soilml.log_import.channels.inputs import Inputs
from soilml.log_import.guesses.drafts.draft import Draft
from soilml.log_import.guesses.drafts.draft_inputs import moving


def signs(drafts: dict[str, Draft], inputs: Inputs) -> None:
    """Turn channels that are against the rotation, so that all that drives is positive."""
    driven = moving(inputs)
    rotation = next((r for r in ("rim_speed", "wheel_speed") if r in inputs.values), None)
    sign = 1.0
    if rotation is not None:
        sign = math.copysign(1.0, float(np.nanmedian(inputs.values[rotation][driven])))
        source = next(r for r in ("wheel_angle", "rim_speed", "wheel_speed") if r in drafts)
        if sign < 0.0:
            drafts[source].put("reverse", True, "it is negative in the log; forward is positive")
    for role, key in (("ground_speed", "ground_speed"), ("position", "ground_speed")):
        if role in drafts and key in inputs.values:
            middle = float(np.nanmedian(inputs.values[key][driven]))
            if middle < 0.0:
                drafts[role].put("reverse", True, "it is negative in the log; forward is positive")
    for role in ("torque", "motor_current", "load", "sinkage"):
        if role not in inputs.values or role not in drafts:
            continue
        values = inputs.values[role]
        driving = float(np.nanmedian(values[driven]))
        if role not in ("load", "sinkage"):
            driving -= np.nan_to_num(inputs.rest.get(role, (0.0, 0.0))[0])
        scatter = float(np.nanstd(values[driven]))
        if driving < -0.5 * scatter:
            why = {"load": "a load is positive", "sinkage": "sinkage is positive"}.get(
                role, "positive where it drives forward"
            )
            drafts[role].put("reverse", True, f"it is negative in the log; {why}")


def sign_of_slip(drafts: dict[str, Draft], inputs: Inputs) -> None:
    """Turn a slip that is below zero where the torque drives, as of logs that count braking up."""
    if not {"slip", "torque"} <= inputs.values.keys() or "torque" not in drafts:
        return
    torque, slip = inputs.values["torque"], inputs.values["slip"]
    sign = -1.0 if drafts["torque"].keys.get("reverse") else 1.0
    size = float(np.nanpercentile(np.abs(torque), 90))
    drives = (sign * torque > 0.5 * size) & np.isfinite(slip) & (slip != 0.0)
    if drives.any() and float(np.mean(slip[drives] < 0.0)) > 0.9:
        drafts["slip"].put("reverse", True, "it is negative in the log where the torque drives")


def sign_of_pull(drafts: dict[str, Draft], inputs: Inputs) -> None:
    """Turn a pull that falls where the torque, or the current of the motor, rises."""
    known = drafts.keys() & inputs.values.keys()
    role = "torque" if "torque" in known else "motor_current"
    if not {role, "drawbar_pull"} <= known:
        return
    torque, pull = inputs.values[role], inputs.values["drawbar_pull"]
    kept = np.flatnonzero(moving(inputs) & np.isfinite(torque) & np.isfinite(pull))
    width = max(1, round(1.0 / inputs.step))
    count = kept.size // width
    if count < 6:
        return
    blocks = kept[: count * width].reshape(count, width)
    means = np.stack([torque[blocks].mean(axis=1), pull[blocks].mean(axis=1)])
    if np.ptp(means, axis=1).min() > 0.0:
        sign = -1.0 if drafts[role].keys.get("reverse") else 1.0
        if sign * float(np.corrcoef(means)[0, 1]) < -0.8:
            why = "it falls in the log where the torque rises"
            drafts["drawbar_pull"].put("reverse", True, why)
