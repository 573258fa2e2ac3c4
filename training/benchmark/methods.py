"""The methods compared: each maps the rows of one soil to an estimate with intervals."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.errors import FitError
from soilml.identification import CLOSED_FORM, identify
from soilml.io.table import Table
from soilml.numerics.prior import Prior
from soilml.onboard.estimate import Estimate
from soilml.onboard.estimator import Estimator
from soilml.processes import FORKS, process_map
from soilml.quantities import Z_50, Z_90, column
from training.benchmark.designs import select_channels
from training.regressors.linear_gaussian import LinearGaussian

#: Label of the prior, and prefix of the labels of analytic methods.
PRIOR_LABEL, ANALYTIC_PREFIX = "prior", "analytic "
#: A user's method: slips, torques (N m) and loads (N) of one soil, each (rows,), to the mean (q,)
#: and the standard deviation (q,) or covariance (q, q) of its parameters, in SI units.
UserMethod = Callable[[Floats, Floats, Floats], tuple[Floats, Floats]]


class MethodKind(Enum):
    """What a row of the benchmark is computed by."""

    BAYES_LIMIT = "exact posterior of the same set"
    PRIOR = "prior alone"
    SET_POSTERIOR = "model file, posterior of all rows of a set"
    REGRESSION = "model file without a set posterior, with a nonlinear regressor"
    LINEAR_REGRESSION = "model file without a set posterior, linear regressors alone"
    ANALYTIC = "analytic identification"
    USER_FUNCTION = "function of the caller"


def classify_estimator(estimator: Estimator) -> MethodKind:
    """The kind of a model file, from its metadata; its file name plays no part.

    A file with a set posterior, for one wheel or for any wheel, answers by it. All others are
    distinguished by the regressors of the training spec that the file holds.
    """
    if estimator.sets is not None:
        return MethodKind.SET_POSTERIOR
    regressors = json.loads(estimator.metadata["spec"]).get("regressor", [])
    if all(entry.get("type") == LinearGaussian.type_name for entry in regressors):
        return MethodKind.LINEAR_REGRESSION
    return MethodKind.REGRESSION


@dataclass(frozen=True)
class MethodEstimate:
    """A method's estimate of one soil: mean (q,), covariance (q, q), interval ends (2, q) each.

    NaN where a parameter is not estimated. `flagged`: the method itself reports its estimate as
    unreliable.
    """

    mean: Floats
    covariance: Floats
    interval50: Floats
    interval90: Floats
    flagged: bool


@dataclass(frozen=True)
class MethodEstimates:
    """The estimates of one method for n sets: as `MethodEstimate`, stacked; NaN where it failed.

    `seconds` is the mean wall time of one estimate.
    """

    mean: Floats
    covariance: Floats
    interval50: Floats
    interval90: Floats
    flagged: NDArray[np.bool_]
    seconds: float

    def subset(self, index: NDArray[np.bool_]) -> MethodEstimates:
        """The estimates of some sets."""
        parts = {f.name: getattr(self, f.name)[index] for f in fields(self) if f.name != "seconds"}
        return replace(self, **parts)


@dataclass(frozen=True)
class Method:
    """A method: label, kind, description of its inputs, and the channels that it reads.

    `estimate` maps the rows of one soil to an estimate, or raises `FitError`.
    """

    label: str
    kind: MethodKind
    inputs: str
    channels: tuple[str, ...]
    estimate: Callable[[Table], MethodEstimate]

    def estimate_sets(
        self,
        sets: Sequence[Table],
        q: int,
        progress: Callable[[int, int], None] = lambda done, total: None,
    ) -> MethodEstimates:
        """Estimates of q parameters for every set, one call each as on board.

        Analytic methods, which are slow, run on all cores.
        """
        failure = gaussian_estimate(np.full(q, np.nan), np.full((q, q), np.nan))
        estimates, seconds = [], 0.0
        workers = None if self.kind is MethodKind.ANALYTIC and FORKS else 1
        with process_map(self._timed_estimate, sets, workers) as results:
            for done, (estimate, duration) in enumerate(results):
                progress(done, len(sets))
                estimates.append(failure if estimate is None else estimate)
                seconds += duration / len(sets)
        progress(len(sets), len(sets))
        names = [field.name for field in fields(MethodEstimate)]
        stacked = {name: np.stack([getattr(e, name) for e in estimates]) for name in names}
        return MethodEstimates(**stacked, seconds=seconds)

    def _timed_estimate(self, rows: Table) -> tuple[MethodEstimate | None, float]:
        """The estimate of one set, None where there is none, and the wall time."""
        started = time.perf_counter()
        try:
            estimate = self.estimate(rows)
        except FitError:
            estimate = None
        return estimate, time.perf_counter() - started


def gaussian_estimate(
    mean: Floats, covariance: Floats, interval90: Floats | None = None, flagged: bool = False
) -> MethodEstimate:
    """An estimate with Gaussian intervals, unless the method provides its own 90 % interval."""
    std = np.sqrt(np.diag(covariance))
    if interval90 is None:
        interval90 = np.stack([mean - Z_90 * std, mean + Z_90 * std])
    interval50 = np.stack([mean - Z_50 * std, mean + Z_50 * std])
    return MethodEstimate(mean, covariance, interval50, interval90, flagged)


def prior_method(priors: Sequence[Prior]) -> Method:
    """The prior alone, whatever is measured."""
    quantiles = [p.at(np.asarray([0.5, 0.25, 0.75, 0.05, 0.95])) for p in priors]
    ends = np.stack(quantiles, axis=1)
    covariance = np.diag([p.std**2 for p in priors])
    estimate = MethodEstimate(ends[0], covariance, ends[1:3], ends[3:], False)
    return Method(PRIOR_LABEL, MethodKind.PRIOR, "-", (), lambda rows: estimate)


def model_file_method(label: str, estimator: Estimator) -> Method:
    """A model file by `Estimator.run`, and without a set posterior single rows by a plain call."""
    plain = estimator.sets is None or estimator.sets.sets_only

    def estimate(rows: Table) -> MethodEstimate:
        readings = {name: rows[column(name)] for name in estimator.inputs}
        if plain and len(rows) == 1:
            return onboard_estimate(estimator(**{n: v[0] for n, v in readings.items()}))
        return onboard_estimate(estimator.run(**readings))

    channels = tuple(n for n in estimator.inputs if n not in ("slip", "load"))
    kind, inputs = classify_estimator(estimator), ", ".join(estimator.inputs)
    return Method(label, kind, inputs, channels, estimate)


def onboard_estimate(estimate: Estimate) -> MethodEstimate:
    """An estimate of the onboard runtime, with a Gaussian 50 % interval."""
    half = Z_50 * estimate.std
    return MethodEstimate(
        estimate.mean,
        estimate.covariance,
        np.stack([estimate.mean - half, estimate.mean + half]),
        np.stack([estimate.low, estimate.high]),
        not bool(estimate.in_range),
    )


def analytic_method(case: Case, name: str, names: Sequence[str]) -> Method:
    """An identification method; it reads sinkage only where its equations need it."""
    channels = ("torque", "sinkage") if name in CLOSED_FORM else ("torque",)
    fixed = {"linear": "; K fixed", "newton": "; c fixed"}.get(name, "")

    def estimate(rows: Table) -> MethodEstimate:
        fit = identify(case, select_channels(rows, channels), list(names), name)
        index = np.asarray([fit.names.index(n) if n in fit.names else -1 for n in names])
        fitted = index >= 0
        mean = np.where(~fitted, np.nan, fit.values[index])
        pairs = np.logical_and.outer(fitted, fitted)
        covariance = np.where(pairs, fit.covariance[np.ix_(index, index)], np.nan)
        interval90 = np.where(np.isnan(mean), np.nan, np.stack(fit.interval)[:, index])
        return gaussian_estimate(
            mean, covariance, interval90, any(w.code == "excess-residuals" for w in fit.warnings)
        )

    inputs = ", ".join(["slip", "load", *channels]) + fixed
    return Method(f"{ANALYTIC_PREFIX}{name}", MethodKind.ANALYTIC, inputs, channels, estimate)


def user_methods(functions: Mapping[str, UserMethod]) -> list[Method]:
    """Functions of the caller as methods, by label; see `UserMethod`."""

    def by(function: UserMethod) -> Callable[[Table], MethodEstimate]:
        def estimate(rows: Table) -> MethodEstimate:
            mean, spread = function(rows["slip"], rows["torque_Nm"], rows["load_N"])
            spread = np.asarray(spread, float)
            covariance = np.diag(spread**2) if spread.ndim == 1 else spread
            return gaussian_estimate(np.asarray(mean, float), covariance)

        return estimate

    kind, inputs = MethodKind.USER_FUNCTION, "slip, torque, load"
    return [Method(label, kind, inputs, ("torque",), by(f)) for label, f in functions.items()]
