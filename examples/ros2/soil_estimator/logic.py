"""What the node does, without ROS: samples in, reports out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from soil_estimator.rows import RowCollector
from soilml import Estimator
from soilml.errors import InputError


@dataclass(frozen=True)
class Report:
    """An estimate in words and numbers.

    Parameters
    ----------
    sound : bool
        Whether the readings agree with a soil of the prior.
    message : str
        One line.
    values : dict of str to float
        Mean and standard deviation of each quantity, in SI units, and the number of rows.
    """

    sound: bool
    message: str
    values: dict[str, float]


class SoilLogic:
    """The soil under one wheel, from raw samples.

    Parameters
    ----------
    estimator : Estimator
        A file with a set posterior, set to the wheel where it is for many.
    rows : RowCollector
        Makes rows of samples.

    Raises
    ------
    InputError
        If the file has no set posterior, or needs the wheel first.
    """

    def __init__(self, estimator: Estimator, rows: RowCollector) -> None:
        self._estimator, self._rows = estimator, rows
        self._memory = estimator.start()
        self._refused = 0

    def restart(self) -> None:
        """Forget all rows: the wheel is on another soil."""
        self._memory = self._estimator.start()
        self._refused = 0

    def add(self, time: float, **samples: float) -> Report | None:
        """Take samples; returns a report when they complete a row. See `RowCollector.add`."""
        row = self._rows.add(time, samples)
        return None if row is None else self._step(row)

    def _step(self, row: Mapping[str, float]) -> Report:
        try:
            estimate, self._memory = self._estimator.step(self._memory, **row)
        except InputError as error:
            self._refused += 1
            return Report(False, f"row refused: {error}", {"rows_refused": float(self._refused)})
        values = {"rows": float(self._memory.rows), "rows_refused": float(self._refused)}
        for name, mean, std in zip(estimate.names, estimate.mean, estimate.std, strict=True):
            values |= {name: float(mean), f"{name}_std": float(std)}
        if not estimate.in_range:
            return Report(False, "out of range, or inconsistent: the prior is given", values)
        vague = [n for n, x in zip(estimate.names, estimate.abstains, strict=True) if x]
        message = f"not determined yet: {', '.join(vague)}" if vague else "all determined"
        return Report(True, message, values)
