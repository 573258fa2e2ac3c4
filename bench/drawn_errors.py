"""All errors that sensors and models usually have, drawn at random for each soil."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from datagen.blind_sets.reference_wheel import ContactArc, Mechanism, WheelState

Floats = np.ndarray[Any, np.dtype[np.float64]]

#: Standard deviations, those that docs/concepts/sets.md lists.
STD = {
    "slip_offset": 0.015,
    "load_gain": 0.01,
    "torque_gain": 0.03,
    "sinkage_offset": 0.0005,  # m
    "pull_offset": 0.01,  # of a typical load
    "bearing": 0.4,
    "bearing_by_slip": 0.8,
    "bearing_by_load": 0.17,
    "contact": 1.0,
    "sinkage_gain": 0.04,
    "pull_error": 0.02,  # of the load
}
#: Height at exit over sinkage of the usual contact behind the axle. A contact that is shorter than
#: assumed ends ahead of the axle, at most at the second share of the angle of the largest stress.
KAPPA, FARTHEST_END = 0.15, 0.8


@dataclass(frozen=True)
class DrawnErrors:
    """Errors of each soil, arrays (sets, 1); or of each row, (rows,)."""

    slip_offset: Floats
    load_gain: Floats
    torque_gain: Floats
    sinkage_offset: Floats
    pull_offset: Floats
    bearing: Floats
    bearing_by_slip: Floats
    bearing_by_load: Floats
    contact: Floats
    sinkage_gain: Floats
    pull_error: Floats

    @staticmethod
    def drawn(sets: int, seed: int, size: float = 1.0) -> DrawnErrors:
        """Normal errors, `size` times the usual ones."""
        rng = np.random.default_rng([seed, 1])
        names = [f.name for f in fields(DrawnErrors)]
        return DrawnErrors(**{n: size * STD[n] * rng.standard_normal((sets, 1)) for n in names})

    def of_rows(self, soil: NDArray[np.int64]) -> DrawnErrors:
        """Errors of rows (rows,) on soils of these numbers; those of sensors are of the first."""
        values = {f.name: getattr(self, f.name)[:, 0] for f in fields(self)}
        of_model = ("bearing", "bearing_by_slip", "bearing_by_load", "contact")
        return DrawnErrors(
            **{n: v[soil if n in of_model else np.zeros_like(soil)] for n, v in values.items()}
        )

    def factor_of_bearing(self, slip: Floats, load: Floats) -> Floats:
        """True bearing pressure over that assumed, of the shape of slip."""
        by_load = self.bearing_by_load * np.log(load / np.median(load))
        return np.asarray(np.exp(self.bearing + self.bearing_by_slip * slip + by_load))

    def mechanism(self, slip: Floats) -> Mechanism:
        """The contact, for rows of the shape of slip, one after another."""
        share = np.broadcast_to(self.contact, slip.shape).reshape(-1)

        def arc(arc: ContactArc, state: WheelState, size: float) -> ContactArc:
            end = -size * share * np.arccos(1.0 - KAPPA * arc.sinkage / state.radius)
            return replace(arc, exit=np.minimum(end, FARTHEST_END * arc.peak))

        return Mechanism("contact", "share", 1.0, "1", {"arc": arc})

    def of_readings(self, true: dict[str, Floats], load: Floats) -> dict[str, Floats]:
        """What sensors read without noise, of the shape of load."""
        pull = self.pull_error * load + self.pull_offset * np.median(load)
        return {
            "torque": (1.0 + self.torque_gain) * true["torque"],
            "sinkage": (1.0 + self.sinkage_gain) * true["sinkage"] + self.sinkage_offset,
            "drawbar_pull": true["drawbar_pull"] + pull,
        }
