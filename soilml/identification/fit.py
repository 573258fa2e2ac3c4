"""The result of an identification, and remarks on what limits it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.errors import InputError
from soilml.fitting.coordinates import Coordinate
from soilml.fitting.levels import is_one_load
from soilml.fitting.misfit import excess_residuals_remark
from soilml.fitting.readings import Readings
from soilml.parameters import unit_text
from soilml.physics.soils.soil_tests import deviations
from soilml.quantities import NOT_IDENTIFIED_ABOVE, WEAKLY_IDENTIFIED_ABOVE, Z_90
from soilml.remarks import Remark, about
from soilml.report.numbers import share_left, significant
from soilml.results import EstimatedValue, Interval, Result

if TYPE_CHECKING:
    from soilml.fitting.fitted_readings import FittedReadings
    from soilml.report.report import Report


#: Size r of a correlation from which on two parameters are reported as a trade-off: one combination
#: of the two, scaled to equal widths, is then known sqrt((1 + r) / (1 - r)) > 6 times better than
#: the other.
STRONG_CORRELATION = 0.95
#: Distance from a bound of the prior, as a fraction of it, at which a value counts as at the bound.
BOUND_TOLERANCE = 1e-3


#: What follows from residuals above the noise where all intervals are as much wider.
WIDENED = "std is multiplied by this factor"
#: Codes of the remarks by which rows speak against the model taken as exact.
AGAINST_EXACT = ("excess-residuals", "unlikely")


@dataclass(frozen=True)
class SoilExplanation:
    """One way in which sensors and model may differ from the model file.

    Attributes
    ----------
    effects
        Names of effects of the catalogue that the model lacks; none for the soil alone.
    discrepancy
        Whether there is a smooth error of the model beside them.
    probability
        Its share in the averaged answer.
    """

    effects: tuple[str, ...]
    discrepancy: bool
    probability: float

    @property
    def exact(self) -> bool:
        """Whether it takes the model, but for its sensors, to be as in the file."""
        return not self.effects and not self.discrepancy

    def __str__(self) -> str:
        """What it says, in words."""
        if self.exact:
            return "typical errors of the sensors alone"
        errors = ("a smooth error of the model",) if self.discrepancy else ()
        return " and ".join((*self.effects, *errors))

    def as_json(self) -> dict[str, Any]:
        """Its content in a report."""
        return {
            "effects": list(self.effects),
            "discrepancy": self.discrepancy,
            "probability": self.probability,
            "text": str(self),
        }


@dataclass(frozen=True, repr=False)
class Fit(Result):
    """Estimates of p parameters with their covariance and warnings.

    `std` is the expected distance between estimate and true value, given the rows, the noise of the
    sensors and the prior. For a parameter that the rows do not determine it can exceed the prior's
    standard deviation: an estimate of least squares may then lie anywhere in the prior.

    Attributes
    ----------
    method
        Name of the method, a key of `METHODS`.
    names, units
        Parameter paths and their SI units, p each.
    values
        Estimates (p,) in SI units.
    covariance
        Covariance (p, p) of the errors of `values`.
    warnings
        What limits the result.
    rows_used
        Number of rows.
    remaining_fraction
        By parameter, its standard deviation after the measurement over that of the prior: 1 where
        the rows are uninformative. Empty for methods without a prior.
    misfit
        Mean squared residual in standard deviations of the noise, per degree of freedom; NaN where
        the noise is not declared.
    channels
        Columns that were fitted.
    low, high
        Ends (p,) of the 90 % interval where the method computes them, as the posterior does, and
        where Gaussian ones would reach beyond the priors.
    samples
        Weighted samples of the posterior (`soilml.identification.posterior.PosteriorSamples`),
        where the method drew them.
    draws
        Equally likely values (n, p) of them, SI units.
    curves
        Gives the readings with the predictions at `values`, for pictures.
    explanations
        Of an averaged fit, the explanations of the rows, the likeliest first.
    """

    method: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    values: Floats
    covariance: Floats
    warnings: tuple[Remark, ...]
    rows_used: int
    remaining_fraction: dict[str, float] = field(default_factory=dict)
    misfit: float = float("nan")
    channels: tuple[str, ...] = ()
    low: Floats | None = None
    high: Floats | None = None
    samples: Any = field(default=None, repr=False, compare=False)
    draws: Floats | None = field(default=None, repr=False, compare=False)
    curves: Callable[[], FittedReadings] | None = field(default=None, repr=False, compare=False)
    explanations: tuple[SoilExplanation, ...] = ()

    @property
    def mean(self) -> Floats:
        """Estimates (p,) in SI units, the same as `values`."""
        return self.values

    @property
    def interval(self) -> Interval:
        """Ends (p,) of the 90 % interval; `interval(level)` has those of another level.

        They are Gaussian where the method does not compute them.
        """
        low, high = self.low, self.high
        if low is None or high is None:
            low, high = self.values - Z_90 * self.std, self.values + Z_90 * self.std
        return Interval.around(self.values, low, high)

    @property
    def std(self) -> Floats:
        """Standard deviations (p,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def correlation(self) -> Floats:
        """Correlations (p, p)."""
        return np.asarray(self.covariance / np.outer(self.std, self.std))

    def __getitem__(self, name: str) -> EstimatedValue:
        """One parameter, which computes as its mean; `InputError` for another name."""
        if name not in self.names:
            raise InputError(f"{name!r} is not identified; there are: {', '.join(self.names)}")
        i = self.names.index(name)
        low, high = self.interval
        return EstimatedValue(
            float(self.values[i]), float(self.std[i]), self.units[i], float(low[i]), float(high[i])
        )

    @property
    def fits(self) -> bool:
        """Whether the rows do not reject model and sensors as in the file."""
        return not any(remark.code in AGAINST_EXACT for remark in self.warnings)

    @property
    def undetermined(self) -> list[str]:
        """Parameters that the rows leave open: all where there are fewer readings than those."""
        unknown = about(self.warnings, "not-identified") | about(self.warnings, "few-readings")
        return [name for name in self.names if name in unknown]

    @property
    def verdict(self) -> str:
        """Whether model and rows agree, and what to do where they do not, in one sentence."""
        against = [remark.code for remark in self.warnings if remark.code in AGAINST_EXACT]
        count = f"{self.rows_used} row{'' if self.rows_used == 1 else 's'}"
        if against:
            size = f" ({significant(float(np.sqrt(self.misfit)), 2)} times the noise; p < 0.001)"
            known = AGAINST_EXACT[0] in against
            return f"The model does not fit these rows{size if known else ''}: run `soilml gap`."
        fits = "" if np.isnan(self.misfit) else "The model fits these rows; "
        few = [remark.text for remark in self.warnings if remark.code == "few-readings"]
        if few:
            return f"{fits}{few[0]}."
        open_ = self.undetermined
        if len(open_) == len(self.names):
            return f"No parameter of the soil is determined by {count}: measure other slips."
        text = f"{fits}{count} determine{'s' if self.rows_used == 1 else ''} "
        text += "the soil" if not open_ else f"the soil, but not {', '.join(open_)}"
        return f"{text[0].upper()}{text[1:]}."

    def report(self) -> Report:
        """Verdict, soil, readings beside the model, and what limits the result."""
        from soilml.identification.report import fit_report

        return fit_report(self)

    def frame_columns(self) -> dict[str, Any]:
        """A row for each parameter: mean, standard deviation, 90 % interval, unit."""
        low, high = self.interval
        return {
            "parameter": list(self.names),
            "mean": self.values,
            "std": self.std,
            "low": low,
            "high": high,
            "unit": list(self.units),
        }

    def as_json(self) -> dict[str, Any]:
        """The content of the file that `soilml identify` writes."""
        correlation, remaining = self.correlation, self.remaining_fraction
        rows = zip(self.names, self.values, self.std, *self.interval, self.units, strict=True)
        content = {
            "verdict": self.verdict,
            "method": self.method,
            "parameters": {
                name: {"value": float(v), "std": float(s), "p05": float(low), "p95": float(high)}
                | {"unit": unit}
                | ({"remaining_fraction": remaining[name]} if name in remaining else {})
                for name, v, s, low, high, unit in rows
            },
            "correlation": {
                a: {b: float(correlation[i, j]) for j, b in enumerate(self.names) if j != i}
                for i, a in enumerate(self.names)
            },
            "warnings": [remark.as_json() for remark in self.warnings],
            "rows_used": self.rows_used,
            "channels_used": list(self.channels),
            "misfit": None if np.isnan(self.misfit) else float(self.misfit),
        }
        if self.explanations:
            content["explanations"] = [one.as_json() for one in self.explanations]
        return content


#: Deviation from a test of the soil, in standard deviations of its scatter, that is remarked on.
NOTABLE = 2.5


def at_prior_bound(u: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether fractions of priors (p,) are at one of the bounds."""
    return np.asarray(np.minimum(u, 1.0 - u) < BOUND_TOLERANCE)


def with_warnings(
    fit: Fit,
    case: Case,
    readings: Readings,
    free: Sequence[Coordinate],
    u: NDArray[np.float64],
    excess_residuals: str,
) -> Fit:
    """The same fit with its warnings.

    u (p,): Its values as fractions of the priors.
    excess_residuals: What follows from residuals that exceed the noise; "" where they do not.
    """
    one_load = is_one_load(readings.row_load)
    remarks: list[Remark] = []
    for i, f in enumerate(free):
        remarks += identifiability_remarks(f.path, fit.remaining_fraction[f.path], one_load)
        if at_prior_bound(u)[i]:
            bound = "lower" if u[i] < 0.5 else "upper"
            text = f"{f.path} is at the {bound} bound of its prior, which determines the estimate"
            remarks.append(Remark("at-prior-bound", text, (f.path,)))
        if f.assumed:
            ends = f"{f.prior.lower:g} to {f.prior.upper:g} {unit_text(f.unit)}".rstrip()
            text = f"{f.path} has no prior: {ends} is assumed"
            remarks.append(Remark("assumed-prior", text, (f.path,)))
    fraction = fit.remaining_fraction.get("cohesion", 1.0)
    if one_load and fraction <= WEAKLY_IDENTIFIED_ABOVE:
        text = "one load only: cohesion is determined by the change with slip alone"
        remarks.append(Remark("one-load", text, ("cohesion",)))
    if len(readings) < len(free):
        count = "1 reading" if len(readings) == 1 else f"{len(readings)} readings"
        text = f"{count} for {len(free)} parameters: the prior determines the rest"
        remarks.append(Remark("few-readings", text, fit.names))
    remarks += trade_offs(fit)
    if excess_residuals:
        remarks.append(excess_residuals_remark(float(np.sqrt(fit.misfit)), case, excess_residuals))
    if names := readings.undeclared:
        text = (
            f"noise of {', '.join(names)} is not declared: estimated from the residuals; declare "
            f'it in [noise] as {names[0]} = "2 %" or in its unit'
        )
        remarks.append(Remark("undeclared-noise", text, names))
    return replace(fit, warnings=(*fit.warnings, *remarks))


def identifiability_remarks(name: str, fraction: float, one_load: bool = False) -> list[Remark]:
    """That a parameter is not or weakly identified, by the remaining fraction of its prior."""
    if one_load and name == "cohesion" and fraction > WEAKLY_IDENTIFIED_ABOVE:
        text = "one load only: cohesion is not identified"
        return [Remark("not-identified", text, (name,))]
    if fraction > NOT_IDENTIFIED_ABOVE:
        text = f"{name} is not identified: {share_left(fraction)} the prior's width remains"
        return [Remark("not-identified", text, (name,))]
    if fraction > WEAKLY_IDENTIFIED_ABOVE:
        text = f"{name} is weakly identified: {fraction:.0%} of the prior's width remains"
        return [Remark("weakly-identified", text, (name,))]
    return []


def trade_offs(fit: Fit) -> list[Remark]:
    """That two parameters compensate each other."""
    correlation = fit.correlation
    text = "{} and {} trade off (correlation {:+.2f}): a combination of the two is identified "
    text += "better than either"
    return [
        Remark("trade-off", text.format(a, b, correlation[i, j]), (a, b))
        for (i, a), (j, b) in combinations(enumerate(fit.names), 2)
        if abs(correlation[i, j]) > STRONG_CORRELATION
    ]


def disagreeing_soil_tests(case: Case, values: Mapping[str, float]) -> list[str]:
    """Each test of the case that a soil with these values is far from, in words."""
    at = np.asarray(list(values.values()))
    each = deviations(case.soil_tests, case.soil, list(values), at)
    return [
        f"{test.label()} was {1e-3 * test.measured:.3g} kPa in the test, and is "
        f"{1e-3 * test.measured * np.exp(z * test.scatter):.3g} kPa by the fitted soil "
        f"({abs(z):.1f} standard deviations)"
        for test, z in zip(case.soil_tests, each, strict=True)
        if abs(z) > NOTABLE
    ]
