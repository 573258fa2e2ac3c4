"""Windows in which the wheel is at rest."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from soilml.log_import.recording import Floats

#: Share of the usual speed of the rim, or of the usual torque, below which a wheel is at rest.
_AT_REST = 0.1
#: Beginning of a log in which the wheel may rest, s, and a slip that is another than there.
_FIRST, _OTHER_SLIP = 0.4, 0.03


def why_at_rest(step: float, quantities: Mapping[str, Floats], rows: NDArray[np.bool_]) -> str:
    """By what the wheel is at rest in a window; "" where it turns, or nothing says it.

    `quantities` are samples (n,) of a run, `rows` (n,) those of the window.
    """
    rim = quantities.get("rim_speed", quantities.get("speed"))
    if rim is not None and np.isfinite(rim[rows]).any():
        usual = float(np.nanpercentile(np.abs(rim), 90))
        rests = float(np.nanmedian(np.abs(rim[rows]))) < _AT_REST * usual
        return "the wheel is at rest" if rests else ""
    torque = quantities.get("torque")
    if torque is None or not np.isfinite(torque[rows]).any():
        return ""
    near_zero = _AT_REST * float(np.nanpercentile(np.abs(torque), 90))
    if float(np.nanmedian(np.abs(torque[rows]))) >= near_zero:
        return ""
    if _slips(step, quantities, rows, near_zero):
        return ""
    return "the torque is near zero: the wheel is probably at rest"


def _slips(
    step: float, quantities: Mapping[str, Floats], rows: NDArray[np.bool_], near_zero: float
) -> bool:
    """Whether a window without torque has a slip of its own: where a wheel begins to brake.

    It is one that varies little and is not that of the rest with which the log begins.
    """
    slip, torque = quantities.get("slip"), quantities["torque"]
    first = max(3, round(_FIRST / step))
    if slip is None or not (np.isfinite(slip[:first]).any() and np.isfinite(slip[rows]).any()):
        return False
    middle = float(np.nanmedian(slip[rows]))
    steady = float(np.nanstd(slip[rows])) < 0.5 * abs(middle)
    rests = np.isfinite(torque[:first]).any() and abs(np.nanmedian(torque[:first])) < near_zero
    return bool(steady and rests and abs(middle - float(np.nanmedian(slip[:first]))) > _OTHER_SLIP)
