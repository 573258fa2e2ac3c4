"""What `estimate` hands to a model file of the rows of one soil."""

from __future__ import annotations

from typing import Any

import numpy as np

from soilml.io.table import Table
from soilml.onboard.estimator import Estimator
from soilml.onboard.set_posterior import OPTIONAL
from soilml.quantities import CHANNELS, column


def row_readings(estimator: Estimator, table: Table) -> dict[str, Any]:
    """What single readings are estimated from, (rows,) by name."""
    return {name: table[column(name)] for name in estimator.inputs}


def joint_readings(estimator: Estimator, table: Table) -> dict[str, Any]:
    """What rows of one soil are estimated from together, (rows,) by name.

    Beside what the file needs, sinkage and drawbar pull where the table has them and the file knows
    their noise, and columns of standard deviations, which stand for the file's own noise.
    """
    found = row_readings(estimator, table)
    if estimator.sets is None:
        return found
    for name in CHANNELS:
        key, spread = column(name), f"{column(name)}_std"
        known = name in estimator.sets.noise or spread in table
        if name in OPTIONAL and key in table and known:
            found[name] = table[key]
        if name in found and spread in table:
            found[f"{name}_std"] = _filled(table[spread], estimator, name, found[name])
    return found


def _filled(spread: Any, estimator: Estimator, name: str, reading: Any) -> Any:
    """Standard deviations with the file's own where the table leaves one blank."""
    constant, share = estimator.sets.noise.get(name, (0.0, 0.0)) if estimator.sets else (0.0, 0.0)
    own = np.hypot(constant, share * np.abs(reading))
    return np.where(np.isfinite(spread) & (spread > 0.0), spread, own)


def channels_said(estimator: Estimator, readings: dict[str, Any]) -> list[str]:
    """Which channels took part, where the file reads more than it needs."""
    if estimator.sets is None:
        return []
    used = [
        f"{name.replace('_', ' ')} ({int(np.isfinite(readings[name]).sum())} rows)"
        for name in CHANNELS
        if name in readings and np.isfinite(readings[name]).any()
    ]
    return [f"reads slip, load and {', '.join(used)}"]
