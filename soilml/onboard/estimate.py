"""An estimate with its uncertainty, and the summary of the prior that it started from."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from soilml.errors import InputError
from soilml.onboard.gaussian_product import (
    PriorSummary,
    distance_to_box,
    gaussian_product,
    narrowed,
)
from soilml.onboard.held_out_errors import HeldOutErrors
from soilml.onboard.set_contract import Floats
from soilml.quantities import NOT_IDENTIFIED_ABOVE, Z_90, column
from soilml.results import LEVEL, EstimatedValue, Result, ends_at

if TYPE_CHECKING:
    from soilml.report.report import Report

#: A mean closer to an end of the prior than so many standard deviations is at the edge.
EDGE_STDS = 1.5
#: Standard deviations from the means at which a narrower prior contradicts them.
CONTRADICTION = 3.72


class Reason(IntEnum):
    """Why an estimate is out of range; 0 where it is not. Numbers are never reused.

    It is then the prior, or, where the rows are inconsistent, widened.
    """

    ESTIMATED = 0
    OUT_OF_RANGE = 1
    INCONSISTENT = 2
    NO_INFORMATION = 3
    CONTRADICTORY = 4

    @property
    def words(self) -> str:
        """The reason as half a sentence."""
        return _WORDS[self]


_WORDS = {
    Reason.ESTIMATED: "estimated from the readings",
    Reason.OUT_OF_RANGE: "the readings, or too many of the rows, are out of range",
    Reason.INCONSISTENT: "no soil of the prior explains all rows",
    Reason.NO_INFORMATION: "no reading has so little noise that it is used",
    Reason.CONTRADICTORY: "the files contradict each other",
}
_NOT_GIVEN: NDArray[Any] = np.zeros(0)  # Stands for a field that follows from the others


@dataclass(frozen=True, repr=False)
class Estimate(Result):
    """Posterior mean, standard deviation and covariance of q quantities, in SI units.

    The leading dimensions ``...`` are those of the readings; an estimate from several readings of
    one soil has none.

    Attributes
    ----------
    names, units : tuple of str
        Name and SI unit of each quantity, for example ``cohesion`` in ``Pa``.
    mean, std : ndarray, shape (..., q)
        Posterior mean and standard deviation. The mean lies inside the range of the prior.
    covariance : ndarray, shape (..., q, q)
        Posterior covariance; its diagonal is ``std**2``.
    low, high : ndarray, shape (..., q)
        Ends of the 90 % interval, inside the range of the prior.
    in_range : ndarray of bool, shape (...)
        False where the readings lie outside the training domain: the estimate is then the prior.
        False also where several readings are inconsistent with any soil of the prior: the estimate
        is then widened as far as the misfit says.
    prior : PriorSummary
        The prior of the same quantities.
    misfit : ndarray, shape (...)
        Least sum of squared residuals in standard deviations, from a set posterior; else NaN.
    disagrees : ndarray of bool, shape (...)
        The fault detector of a set posterior: the rows disagree with the exact model, and with
        sensors that have the errors that are declared or usual; the interval allows for errors of
        the model. A unit, a sensor, the wheel or the model is then wrong. One in a hundred sound
        sets is flagged; where it is False, nothing is proven.
    exact_misfit : ndarray, shape (...)
        The misfit with the exact model; else NaN.
    rows_used, rows_set_aside : ndarray of int, shape (...)
        Rows in the training range, which the estimate uses, and rows out of it, which it does not.
        Rows that repeat another one are in neither.
    reason : ndarray of int, shape (...)
        A `Reason`: why `in_range` is false, and 0 where it is true.
    load : ndarray, shape (...)
        The load (N) of a single reading, where the file reads it; else NaN.
    errors : HeldOutErrors or None
        Errors of the file that made the estimate, for `soilml.onboard.multi_sensor`.

    Examples
    --------
    >>> from soilml.onboard import Estimator
    >>> estimate = Estimator.load("exported/wheel.onnx")(slip=0.3, torque=2.1, load=60.0)
    >>> mean, std = estimate["friction_angle"]
    >>> f"{mean:.2f} +- {std:.2f} rad"
    '0.50 +- 0.05 rad'
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    mean: Floats
    std: Floats
    covariance: Floats
    low: Floats
    high: Floats
    in_range: NDArray[np.bool_]
    prior: PriorSummary
    errors: HeldOutErrors | None = field(default=None, repr=False)
    misfit: Floats = field(default_factory=lambda: _NOT_GIVEN)
    disagrees: NDArray[Any] = field(default_factory=lambda: _NOT_GIVEN)
    exact_misfit: Floats = field(default_factory=lambda: _NOT_GIVEN)
    rows_used: NDArray[Any] = field(default_factory=lambda: _NOT_GIVEN)
    rows_set_aside: NDArray[Any] = field(default_factory=lambda: _NOT_GIVEN)
    reason: NDArray[Any] = field(default_factory=lambda: _NOT_GIVEN)
    load: Floats = field(default_factory=lambda: _NOT_GIVEN)

    #: The fields that are arrays with the leading dimensions of the readings.
    ARRAYS: ClassVar[tuple[str, ...]] = (
        *("mean", "std", "covariance", "low", "high", "in_range"),
        *("misfit", "disagrees", "exact_misfit"),
        *("rows_used", "rows_set_aside", "reason", "load"),
    )

    def __post_init__(self) -> None:
        """Fields that are not given are those of single readings."""
        inside = np.asarray(self.in_range)
        made: Any = dict.fromkeys(
            ("misfit", "exact_misfit", "load"),
            lambda: np.full(inside.shape, np.nan),
        )
        made |= {"disagrees": lambda: np.zeros(inside.shape, dtype=bool)}
        made |= {"rows_used": lambda: inside.astype(int)}
        made |= dict.fromkeys(("rows_set_aside", "reason"), lambda: (~inside).astype(int))
        for name, value in made.items():  # out of range is reason 1
            if getattr(self, name) is _NOT_GIVEN:
                object.__setattr__(self, name, value())

    @staticmethod
    def gaussian(
        names: tuple[str, ...],
        units: tuple[str, ...],
        prior: PriorSummary,
        mean: Floats,
        covariance: Floats,
        std: Floats,
        in_range: NDArray[np.bool_],
        coverage_factor: Floats,
        errors: HeldOutErrors | None = None,
        load: Floats | None = None,
    ) -> Estimate:
        """An estimate whose 90 % interval is ``mean -+ coverage_factor * std``.

        The interval is cut at the ends of the prior's range. Where `in_range` is false, the
        coverage factor of a Gaussian is used instead of the calibrated one, (q,).
        """
        half = np.where(in_range[..., None], coverage_factor, Z_90) * std
        return Estimate(
            names=names,
            units=units,
            mean=mean,
            std=std,
            covariance=covariance,
            low=np.minimum(np.maximum(mean - half, prior.lower), prior.upper),
            high=np.minimum(np.maximum(mean + half, prior.lower), prior.upper),
            in_range=in_range,
            prior=prior,
            errors=errors,
            load=_NOT_GIVEN if load is None else load,
        )

    @staticmethod
    def from_prior(
        names: tuple[str, ...],
        units: tuple[str, ...],
        prior: PriorSummary,
        shape: tuple[int, ...] = (),
        errors: HeldOutErrors | None = None,
    ) -> Estimate:
        """The prior itself as an estimate of a given leading shape, with `in_range` false.

        Raises `InputError` for a shape that is not of whole numbers of zero or more.
        """
        if not all(isinstance(size, int | np.integer) and size >= 0 for size in shape):
            raise InputError(f"shape is {shape}; needed are whole numbers of zero or more")
        q = len(names)
        mean, std = (np.broadcast_to(x, (*shape, q)).copy() for x in (prior.mean, prior.std))
        covariance = np.broadcast_to(np.diag(prior.std**2), (*shape, q, q)).copy()
        in_range, factor = np.zeros(shape, dtype=bool), np.full(q, Z_90)
        parts = (mean, covariance, std, in_range, factor, errors)
        return Estimate.gaussian(names, units, prior, *parts)

    @staticmethod
    def stack(estimates: Iterable[Estimate], shape: tuple[int, ...]) -> Estimate:
        """Estimates of the same quantities as one; `shape` is put before their own dimensions.

        They are taken one after the other, so that an iterator's are never held together. Raises
        `InputError` where there is none.
        """
        parts: dict[str, Any] = {}
        for i, estimate in enumerate(estimates):
            for key in Estimate.ARRAYS:
                value = np.asarray(getattr(estimate, key))
                if i == 0:
                    parts[key] = np.empty((math.prod(shape), *value.shape), value.dtype)
                parts[key][i] = value
        if not parts:
            raise InputError("no reading given; needed is one or more")
        own = {key: value.reshape((*shape, *value.shape[1:])) for key, value in parts.items()}
        return replace(estimate, **own)

    def at(self, index: Any) -> Estimate:
        """The estimate of one reading, or of several, by an index of the leading dimensions."""
        return replace(self, **{key: np.asarray(getattr(self, key))[index] for key in self.ARRAYS})

    @property
    def abstains(self) -> NDArray[np.bool_]:
        """Whether each quantity is still mostly the prior, (..., q), or the row is out of range."""
        vague = self.std > NOT_IDENTIFIED_ABOVE * self.prior_std
        return np.asarray(vague | ~np.asarray(self.in_range)[..., None])

    @property
    def at_edge(self) -> NDArray[np.bool_]:
        """Whether a mean is within 1.5 standard deviations of an end of its prior, (..., q).

        A soil outside of the prior shows in this way.
        """
        low = self.mean - EDGE_STDS * self.std < self.prior.lower
        return np.asarray(low | (self.mean + EDGE_STDS * self.std > self.prior.upper))

    @property
    def explanation(self) -> Any:
        """The reason in words: a text, or an array (...) of texts."""
        words = np.asarray([reason.words for reason in Reason], dtype=object)
        return words[self.reason]

    @property
    def prior_std(self) -> Floats:
        """Standard deviation of the prior, (q,)."""
        return self.prior.std

    def within(self, **box: tuple[float, float]) -> Estimate:
        """The estimate where the soil is known to lie in a box within the prior.

        Parameters
        ----------
        **box : (float, float)
            Least and largest value of a quantity in SI units, by its name; the prior is uniform
            between them. Other quantities keep their prior.

        Returns
        -------
        Estimate
            Its `prior` is the narrower one, whose mean and covariance take the place of the wider
            one's (`gaussian_product`). Where the box is `CONTRADICTION` standard deviations from
            the means, the readings contradict it: `in_range` is false, and the answer is the
            narrower prior, as it is where the estimate was the prior.

        Raises
        ------
        InputError
            For a name that is not estimated, and ends that are not in the prior and in order.

        Examples
        --------
        >>> from soilml.onboard import Estimator
        >>> estimator = Estimator.load("exported/wheel.onnx")
        >>> wide = estimator.run(slip=[0.1, 0.3], torque=[1.6, 2.7], load=[60.0, 60.0])
        >>> narrow = wide.within(cohesion=(200.0, 800.0))
        >>> print(f"{wide['cohesion'][1]:.0f} Pa, {narrow['cohesion'][1]:.0f} Pa")
        720 Pa, 172 Pa
        """
        prior = narrowed(self.prior, self.names, self.units, box)
        lower, upper = prior.lower, prior.upper
        informed = self.in_range | (self.reason == Reason.INCONSISTENT)
        contradicted = informed & (
            distance_to_box(self.mean, self.covariance, prior) > CONTRADICTION
        )
        found = Estimate.from_prior(self.names, self.units, prior, np.shape(self.in_range))
        for at in np.ndindex(np.shape(self.in_range)):
            if informed[at] and not contradicted[at]:
                found.mean[at], found.covariance[at] = gaussian_product(
                    self.mean[at][None], self.covariance[at][None], self.prior, after=prior
                )
        found = Estimate.gaussian(
            *(self.names, self.units, prior, np.clip(found.mean, lower, upper), found.covariance),
            np.sqrt(np.diagonal(found.covariance, axis1=-2, axis2=-1)),
            np.asarray(self.in_range & ~contradicted),
            np.full(len(self.names), Z_90),
        )
        changed: Any = {key: getattr(found, key) for key in ("prior", *Estimate.ARRAYS[:6])}
        changed["reason"] = np.where(contradicted, Reason.INCONSISTENT, self.reason)
        return replace(self, **changed)

    def __getitem__(self, name: str) -> EstimatedValue:
        """One quantity (...), which unpacks to mean and standard deviation.

        Raises `InputError` for another name.
        """
        if name not in self.names:
            raise InputError(f"{name!r} is not estimated; there are: {', '.join(self.names)}")
        i = self.names.index(name)
        mean, std, low, high = (x[..., i] for x in (self.mean, self.std, self.low, self.high))
        return EstimatedValue(mean, std, self.units[i], low, high)

    def interval(self, level: float = LEVEL) -> tuple[Floats, Floats]:
        """Ends (..., q) of the central interval of this probability, inside the prior's range.

        See `soilml.results.ends_at`.
        """
        low, high = ends_at(level, self.mean, self.low, self.high)
        return np.maximum(low, self.prior.lower), np.minimum(high, self.prior.upper)

    @property
    def verdict(self) -> str:
        """Whether the readings determine the quantities, in one sentence."""
        known, total = np.asarray(self.in_range), int(np.size(self.in_range))
        if total != 1:
            return f"{int(known.sum())} of {total} readings are in the training range."
        if not known.all():
            reason = str(np.atleast_1d(self.explanation).ravel()[0])
            return f"No estimate: {reason}; the values are not a measurement."
        if bool(np.any(self.disagrees)):
            return "The rows disagree with the exact model: run `soilml gap`."
        vague = [name for name, no in zip(self.names, self.abstains.reshape(-1), strict=True) if no]
        if len(vague) == len(self.names):
            return "The readings determine no quantity: measure other slips and loads."
        if vague:
            return f"The readings do not determine {', '.join(vague)}; they determine the rest."
        return "The readings determine all quantities."

    def report(self, labels: Sequence[str] | None = None) -> Report:
        """The verdict, each quantity of a single estimate, and intervals beside the prior.

        Readings are labelled by their number, or by `labels`.
        """
        from soilml.report.column_figure import ParameterIntervals
        from soilml.report.report import Report
        from soilml.report.tables import ReportTable

        q, columns = len(self.names), self.frame_columns()
        mean, low, high = (v.reshape(-1, q) for v in (self.mean, self.low, self.high))
        labels = labels or [str(i) for i in range(1, len(mean) + 1)]
        ends = self.prior.lower, self.prior.upper
        drawn = ParameterIntervals(self.names, self.units, labels, mean, low, high, *ends)
        one = "quantity" in columns
        if one:
            columns["parameter"] = columns["quantity"]
        return Report(
            kind="estimate",
            verdict=self.verdict,
            figures=ReportTable.of_parameters("Soil", columns) if one else None,
            tables=[] if one else [ReportTable.of("Estimates", columns)],
            pictures=[drawn.picture()],
            title="Estimate",
        )

    def frame_columns(self) -> dict[str, Any]:
        """A row for each quantity of a single estimate; for each reading of several.

        Columns of readings are those of the file that `soilml estimate` writes: the mean, and what
        ends in _std, _p05 and _p95, with the unit in the name.
        """
        if np.ndim(self.in_range) == 0:
            parts = {key: list(getattr(self, key)) for key in ("mean", "std", "low", "high")}
            return {"quantity": list(self.names), **parts, "unit": list(self.units)}
        columns: dict[str, Any] = {"reading": np.arange(np.size(self.in_range))}
        return columns | self.reading_columns()

    def reading_columns(self) -> dict[str, Any]:
        """Mean, std and interval of every quantity, and in_range, (readings,) by column name."""
        columns: dict[str, Any] = {}
        for i, name in enumerate(self.names):
            key = column(name)
            for ending, values in (
                ("", self.mean), ("_std", self.std), ("_p05", self.low), ("_p95", self.high)
            ):  # fmt: skip
                columns[key + ending] = values[..., i].ravel()
        columns["in_range"] = np.asarray(self.in_range).ravel()
        return columns
