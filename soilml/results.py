"""What every result has in common: a short text, a data frame, and values with their uncertainty.

pandas is imported inside functions, so that results are made without it, on board too.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin
from numpy.typing import NDArray

from soilml.errors import InputError, MissingLibraryError

LEVEL = 0.9  # Probability of the intervals that results store as `low` and `high`
Ends = tuple[Any, Any]


def ends_at(level: float, mean: Any, low: Any, high: Any) -> Ends:
    """Ends of the central interval of a probability, from those of the 90 % interval.

    Each side is scaled as that of a normal distribution, so that 90 % gives `low` and `high`.
    Raises `InputError` for a level that is not between 0 and 1.
    """
    if not 0.0 < level < 1.0:
        raise InputError(f"the level of an interval is {level!r}; needed is one in (0, 1), as 0.9")
    if level == LEVEL:
        return low, high
    ratio = _normal_half_width(level) / _normal_half_width(LEVEL)
    return mean - ratio * (mean - low), mean + ratio * (high - mean)


def _normal_half_width(level: float) -> float:
    """Half the central interval of a normal distribution in standard deviations."""
    from statistics import NormalDist

    return NormalDist().inv_cdf(0.5 + 0.5 * level)


@dataclass(frozen=True, eq=False, repr=False)
class EstimatedValue(NDArrayOperatorsMixin):
    """One estimated quantity, or several of one kind: mean, standard deviation, interval, unit.

    It computes as its mean does, and unpacks to mean and standard deviation.

    Attributes
    ----------
    value, std
        Mean and standard deviation, numbers or arrays (...) in the unit.
    unit
        SI unit.
    low, high
        Ends of the 90 % interval; None for those of a normal distribution.

    Examples
    --------
    >>> found = EstimatedValue(1300.0, 200.0, "Pa")
    >>> found
    1300 +- 200 Pa
    >>> float(found), [round(float(end)) for end in found.interval(0.5)]
    (1300.0, [1165, 1435])
    >>> mean, std = found
    """

    value: Any
    std: Any
    unit: str
    low: Any = field(default=None, metadata={"json": False})
    high: Any = field(default=None, metadata={"json": False})

    @property
    def mean(self) -> Any:
        """The mean, the same as `value`."""
        return self.value

    def interval(self, level: float = LEVEL) -> Ends:
        """Ends of the central interval of this probability; see `ends_at`."""
        if self.low is None or self.high is None:
            half = _normal_half_width(LEVEL) * self.std
            return ends_at(level, self.value, self.value - half, self.value + half)
        return ends_at(level, self.value, self.low, self.high)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return np.array(self.value, dtype)

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **options: Any) -> Any:
        plain = [x.value if isinstance(x, EstimatedValue) else x for x in inputs]
        return getattr(ufunc, method)(*plain, **options)

    def __float__(self) -> float:
        return float(self.value)

    def __format__(self, form: str) -> str:
        return format(float(self), form) if form else str(self)

    def __iter__(self) -> Any:
        return iter((self.value, self.std))

    def __len__(self) -> int:
        return 2

    def __getitem__(self, index: Any) -> Any:
        return (self.value, self.std)[index]

    def __eq__(self, other: object) -> Any:
        if isinstance(other, EstimatedValue):
            own, its = ((x.value, x.std, x.unit, x.low, x.high) for x in (self, other))
            return all(np.array_equal(a, b) for a, b in zip(own, its, strict=True))
        if not isinstance(other, int | float | np.generic | np.ndarray):
            return NotImplemented
        return np.equal(self.value, other)

    def __ne__(self, other: object) -> Any:
        return np.logical_not(self == other)

    def __hash__(self) -> int:
        return hash((float(self.value), float(self.std), self.unit))

    def __repr__(self) -> str:
        if np.ndim(self.value):
            return f"<{np.shape(self.value)} values in {self.unit}: mean, std, interval(level)>"
        mean, std = float(self.value), float(self.std)
        if not (std > 0.0 and np.isfinite(std)):
            return f"{mean:.6g} {self.unit}".rstrip()
        digits = 1 - int(np.floor(np.log10(std)))  # two of the standard deviation are known
        shown = [f"{round(x, digits):.{max(digits, 0)}f}" for x in (mean, std)]
        return f"{shown[0]} +- {shown[1]} {self.unit}".rstrip()


class Interval(tuple[NDArray[np.float64], NDArray[np.float64]]):
    """Ends of the 90 % interval; called with another level, those of that one."""

    mean: NDArray[np.float64]

    @staticmethod
    def around(mean: NDArray[np.float64], low: Any, high: Any) -> Interval:
        """The ends about a mean, arrays (p,)."""
        found = Interval((low, high))
        found.mean = mean
        return found

    def __call__(self, level: float = LEVEL) -> Ends:
        """Ends of the central interval of this probability; see `ends_at`."""
        return ends_at(level, self.mean, *self)


class Result:
    """A result of an analysis: `summary` for people, `to_frame` for pandas.

    Its class gives `report`, of which all texts and pages are made, and `frame_columns`; the
    frame's index is the first of these columns.
    """

    def report(self) -> Any:
        """What the result says, as a `soilml.report.report.Report`."""
        raise NotImplementedError

    def frame_columns(self) -> dict[str, Any]:
        """Columns of `to_frame` in SI units, of which the first one is the index."""
        raise NotImplementedError

    def summary(self) -> str:
        """The verdict in the first line, then at most five lines."""
        return str(self.report().summary())

    def to_frame(self) -> Any:
        """A pandas data frame in SI units: one row for each parameter, or for each reading.

        Raises `MissingLibraryError` without pandas.
        """
        columns = self.frame_columns()
        return data_frame(columns).set_index(next(iter(columns)))

    def plot(self, ax: Any = None) -> Any:
        """Draw the first picture of the report; returns its axes.

        ax: Axes of matplotlib, as many as it has panels; a new figure where None.

        Raises `InputError` for another number of axes, and where there is nothing to draw.
        """
        report = self.report()
        if not report.pictures:
            raise InputError(f"there is no picture of this result: {report.verdict}")
        return report.pictures[0].plot(ax)

    def __str__(self) -> str:
        return self.summary()

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.report().verdict}>"

    def _repr_html_(self) -> str:
        """Verdict, lines and the first table, for notebooks; needs no pandas."""
        return str(self.report()._repr_html_())


def data_frame(columns: dict[str, Any]) -> Any:
    """A pandas data frame of these columns; `MissingLibraryError` without pandas."""
    try:
        import pandas as pd
    except ImportError:
        raise MissingLibraryError("a data frame needs pandas: pip install '.[ground]'") from None
    return pd.DataFrame(columns)


def is_frame(rows: object) -> bool:
    """Whether an object is a data frame of pandas: it has columns and an index."""
    return hasattr(rows, "columns") and hasattr(rows, "index") and hasattr(rows, "loc")
