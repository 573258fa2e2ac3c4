"""The methods that are compared, all asked alike: the rows of one soil in, an answer out."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.errors import FitError
from soilml.identification import CLOSED_FORM, identify
from soilml.identification.diagnostics import SURPLUS
from soilml.io.table import Table
from soilml.numerics.prior import Prior
from soilml.onboard.estimate import Estimate
from soilml.onboard.estimator import Estimator
from soilml.quantities import column
from training.benchmark.designs import shown
from training.calibration.scores import HALF, NINETY

Floats = NDArray[np.float64]

#: The line of the prior, and what stands before the name of an analytic method.
PRIOR, ANALYTIC = "prior", "analytic "
#: What stands behind a model file's name where its estimates of single rows are joined.
JOINED = ", joined"
#: A method of one's own: slips, torques (N m) and loads (N) of one soil, each (rows,), to the mean
#: (q,) and the standard deviation (q,) or covariance (q, q) of its parameters, SI units.
Own = Callable[[Floats, Floats, Floats], tuple[Floats, Floats]]


@dataclass(frozen=True)
class MethodAnswer:
    """What a method says of one soil: mean and std (q,), covariance (q, q), interval ends (2, q).

    NaN where it does not estimate a parameter. `inner` holds 50 % by the method's own word, `outer`
    90 %. `flagged`: the method itself says that it is not to be believed.
    """

    mean: Floats
    covariance: Floats
    inner: Floats
    outer: Floats
    flagged: bool


@dataclass(frozen=True)
class MethodAnswers:
    """One method's answers for sets (n,): as `MethodAnswer`, stacked; NaN where it failed."""

    mean: Floats
    covariance: Floats
    inner: Floats
    outer: Floats
    flagged: NDArray[np.bool_]
    seconds: float

    def rows(self, index: NDArray[np.bool_]) -> MethodAnswers:
        """Those of some sets."""
        return MethodAnswers(
            self.mean[index],
            self.covariance[index],
            self.inner[index],
            self.outer[index],
            self.flagged[index],
            self.seconds,
        )


@dataclass(frozen=True)
class Method:
    """A method by name; `ask` answers for the rows of one soil, or raises `FitError`."""

    name: str
    inputs: str
    channels: tuple[str, ...]
    ask: Callable[[Table], MethodAnswer]

    def answers(
        self,
        sets: Sequence[Table],
        q: int,
        progress: Callable[[int, int], None] = lambda done, total: None,
    ) -> MethodAnswers:
        """One call for each set, as on board, for q parameters."""
        none = gaussian(np.full(q, np.nan), np.full((q, q), np.nan))
        found = []
        started = time.perf_counter()
        for done, rows in enumerate(sets):
            progress(done, len(sets))
            try:
                found.append(self.ask(rows))
            except FitError:
                found.append(none)
        seconds = (time.perf_counter() - started) / max(len(sets), 1)
        progress(len(sets), len(sets))
        return MethodAnswers(
            np.stack([a.mean for a in found]),
            np.stack([a.covariance for a in found]),
            np.stack([a.inner for a in found]),
            np.stack([a.outer for a in found]),
            np.asarray([a.flagged for a in found]),
            seconds,
        )


def held(truth: Floats, ends: Floats) -> Floats:
    """Share (q,) of truths (n, q) inside intervals (n, 2, q), of those that there are."""
    there = np.isfinite(ends).all(axis=1)
    inside = (truth >= ends[:, 0]) & (truth <= ends[:, 1]) & there
    count = there.sum(axis=0)
    return np.where(count > 0, inside.sum(axis=0) / np.maximum(count, 1), np.nan)


def gaussian(
    mean: Floats, covariance: Floats, outer: Floats | None = None, flagged: bool = False
) -> MethodAnswer:
    """An answer whose intervals, where it does not give its own, are a Gaussian's."""
    std = np.sqrt(np.diag(covariance))
    outer = np.stack([mean - NINETY * std, mean + NINETY * std]) if outer is None else outer
    return MethodAnswer(
        mean, covariance, np.stack([mean - HALF * std, mean + HALF * std]), outer, flagged
    )


def prior_alone(priors: Sequence[Prior]) -> Method:
    """What is known before anything is measured."""
    ends = np.stack([p.at(np.asarray([0.5, 0.25, 0.75, 0.05, 0.95])) for p in priors], axis=1)
    covariance = np.diag([p.std**2 for p in priors])
    answer = MethodAnswer(ends[0], covariance, ends[1:3], ends[3:], False)
    return Method(PRIOR, "-", (), lambda rows: answer)


def trained(label: str, estimator: Estimator) -> list[Method]:
    """A model file's line; two lines where it offers two ways to join the rows of a soil.

    `run` is what the file answers with. Where that is its set posterior, and it estimates single
    readings too, these joined by the fusion rule are a line of their own, in which one row is a
    plain call.
    """
    used = ", ".join(estimator.inputs)
    both = estimator.sets is not None and not estimator.sets.alone

    def asked(call: Callable[..., Estimate], single: bool) -> Callable[[Table], MethodAnswer]:
        def ask(rows: Table) -> MethodAnswer:
            readings = {name: rows[column(name)] for name in estimator.inputs}
            if single and len(rows) == 1:
                return estimated(estimator(**{n: v[0] for n, v in readings.items()}))
            return estimated(call(**readings))

        return ask

    channels = tuple(n for n in estimator.inputs if n not in ("slip", "load"))
    if not both:
        return [Method(label, used, channels, asked(estimator.run, True))]
    return [
        Method(f"{label}{JOINED}", used, channels, asked(estimator.joined, True)),
        Method(label, used, channels, asked(estimator.run, False)),
    ]


def estimated(estimate: Estimate) -> MethodAnswer:
    """An onboard estimate as an answer."""
    half = HALF * estimate.std
    return MethodAnswer(
        estimate.mean,
        estimate.covariance,
        np.stack([estimate.mean - half, estimate.mean + half]),
        np.stack([estimate.low, estimate.high]),
        not bool(estimate.in_range),
    )


def analytic(case: Case, method: str, names: Sequence[str]) -> Method:
    """An identification method, shown slip, load, torque, and sinkage only where it needs that."""
    channels = ("torque", "sinkage") if method in CLOSED_FORM else ("torque",)
    given = {"linear": "; K given", "newton": "; c given"}.get(method, "")

    def ask(rows: Table) -> MethodAnswer:
        fit = identify(case, shown(rows, channels), list(names), method)
        own = [fit.names.index(n) if n in fit.names else -1 for n in names]
        mean = np.where(np.asarray(own) < 0, np.nan, fit.values[own])
        both = np.logical_and.outer(np.asarray(own) >= 0, np.asarray(own) >= 0)
        covariance = np.where(both, fit.covariance[np.ix_(own, own)], np.nan)
        outer = np.where(np.isnan(mean), np.nan, np.stack(fit.interval)[:, own])
        return gaussian(mean, covariance, outer, any(SURPLUS in w for w in fit.warnings))

    used = ", ".join(["slip", "load", *channels]) + given
    return Method(f"{ANALYTIC}{method}", used, channels, ask)


def own_methods(functions: Mapping[str, Own]) -> list[Method]:
    """Functions of one's own as methods, by the name of their line; see `Own`."""

    def asked(function: Own) -> Callable[[Table], MethodAnswer]:
        def ask(rows: Table) -> MethodAnswer:
            mean, spread = function(rows["slip"], rows["torque_Nm"], rows["load_N"])
            spread = np.asarray(spread, float)
            covariance = np.diag(spread**2) if spread.ndim == 1 else spread
            return gaussian(np.asarray(mean, float), covariance)

        return ask

    used = "slip, torque, load"
    return [Method(name, used, ("torque",), asked(f)) for name, f in functions.items()]
