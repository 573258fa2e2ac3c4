"""The samples of a run as a draft of a map reads them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from soilml.errors import SoilmlError
from soilml.io.toml_settings import Settings
from soilml.log_import.channels.inputs import Inputs, wheel_inputs
from soilml.log_import.channels.runs import Run
from soilml.log_import.guesses.drafts.draft import Draft
from soilml.log_import.mapping.channel import take_channel
from soilml.log_import.mapping.log_map import WheelMap
from soilml.log_import.recording import Floats
from soilml.log_import.units.uncertain_value import Uncertain


def wheel_of(drafts: dict[str, Draft]) -> WheelMap:
    """The channels of a draft as a wheel with a radius of 1 m; raises `InputError`."""
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


def moving(inputs: Inputs) -> NDArray[np.bool_]:
    """Samples (n,) in which the wheel drives; all of them where no speed is known."""
    speed = inputs.values.get("wheel_speed", inputs.values.get("rim_speed"))
    if speed is None:
        speed = inputs.values.get("ground_speed")
    if speed is None:
        return np.ones(inputs.time.size, dtype=bool)
    size: Floats = np.abs(np.nan_to_num(speed))
    return np.asarray(size > 0.3 * np.percentile(size, 90))


def fastest_ratio(inputs: Inputs) -> float:
    """Largest ratio of travel (m/s) to rotation (rad/s, or rim speed), of means over a second."""
    rotation = inputs.values.get("rim_speed", inputs.values.get("wheel_speed"))
    ground = inputs.values.get("ground_speed")
    if rotation is None or ground is None:
        return float("nan")
    driven = moving(inputs) & np.isfinite(rotation) & np.isfinite(ground)
    width = max(1, round(2.0 / inputs.step))
    kept = np.flatnonzero(driven)
    count = kept.size // width
    if count < 2:
        return float("nan")
    blocks = kept[: count * width].reshape(count, width)
    ratios = np.abs(ground[blocks].mean(axis=1)) / np.abs(rotation[blocks].mean(axis=1))
    return float(np.percentile(ratios, 95))
