"""Rows for the estimator, each the mean of a stretch of raw samples."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import isfinite, nan

from soil_estimator.slip import slip_of


@dataclass
class RowCollector:
    """Collects samples of the wheel and of the rover, and makes a row of every `period` seconds.

    Samples closer together than sinkage and shear need to settle are no independent readings; the
    mean over a second or so is one reading.

    Parameters
    ----------
    wheel_radius : float
        m.
    load : float
        Load on the wheel in N, where no sensor measures it.
    period : float
        Length of a stretch, s.
    least_speed : float
        Speed of the rim (m/s) below which the wheel counts as standing.
    """

    wheel_radius: float
    load: float
    period: float = 1.0
    least_speed: float = 0.01
    _started: float = nan
    _samples: dict[str, list[float]] = field(default_factory=dict)

    def add(self, time: float, samples: Mapping[str, float]) -> dict[str, float] | None:
        """Take samples at a time (s); returns a row when a stretch is complete.

        Parameters
        ----------
        time : float
            s; a time before the present stretch, as after a reset of the clock, begins another.
        samples : mapping
            Any of `wheel_speed` (rad/s), `torque` (N m), `speed` (m/s), `load` (N), `sinkage` (m)
            and `drawbar_pull` (N); what is not finite is left out.
        """
        row = None
        if not 0.0 <= time - self._started < self.period:
            row = self._row() if time >= self._started else None
            self._started, self._samples = time, {}
        for name, value in samples.items():
            if isfinite(value):
                self._samples.setdefault(name, []).append(value)
        return row

    def _row(self) -> dict[str, float] | None:
        """The row of a stretch; None while the wheel stands or a sensor is silent."""
        mean = {name: sum(values) / len(values) for name, values in self._samples.items()}
        if not {"wheel_speed", "torque", "speed"} <= mean.keys():
            return None
        rim_speed = mean["wheel_speed"] * self.wheel_radius
        if rim_speed < self.least_speed or mean["speed"] <= 0.0:
            return None
        row = {
            "slip": slip_of(rim_speed, mean["speed"]),
            "torque": mean["torque"],
            "load": mean.get("load", self.load),
        }
        optional = ("sinkage", "drawbar_pull")
        return row | {name: mean[name] for name in optional if name in mean}
