"""Marginal likelihood of a fit, with a smooth discrepancy of unknown amplitude."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from math import erfc, exp, log, pi, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats, Integers
from soilml.fitting.coordinates import Coordinate
from soilml.fitting.covariance import DiscrepancyProcess, Whitening
from soilml.fitting.least_squares import Solution
from soilml.gap.evidence.covariance import Covariance
from soilml.gap.evidence.linearised_fit import AMPLITUDES, LinearisedFit, ProcessDivisions
from soilml.numerics.prior import UNIFORM_PRECISION

#: Precision of the size of an effect whose prior is added afterwards, in reference sizes: so weak
#: that it does not shrink the size, and strong enough for an effect without influence.
WEAK_PRECISION = 0.1
#: Range over which the logarithm of a physical effect's size is nearly uniform, in reference sizes.
SMALLEST_SIZE, LARGEST_SIZE = 0.01, 5.0
#: Further powers with which the prior density of a size falls beyond the largest usual one.
TAIL_POWER = 2.0
#: Factor on differences of the evidence: below 1, because Laplace's approximation, the amplitudes
#: at their maximum and estimated covariances overstate it. With it, the stated probabilities of
#: 300 sets of `datagen.blind_sets` (seed 7, not the published benchmark's) met the frequencies.
TEMPERING = 0.5
#: Sweeps over the channels; the amplitudes of different channels depend little on each other.
SWEEPS = 2


@dataclass(frozen=True)
class Evidence:
    """Evidence for a fit, at the most probable amplitudes of the discrepancy.

    `value` is -2 ln of the marginal posterior probability, up to a constant that all fits share:
    the smaller it is, the larger the evidence.

    `amplitude` has the amplitudes of the discrepancy by channel, in usual ones, at which the
    evidence is largest. `expected_amplitude` is their root mean square over the probability of each
    amplitude, which intervals need: the most probable amplitude is often zero where a discrepancy
    is not excluded. It is not computed where further effects are screened.
    """

    value: float
    amplitude: Floats
    step: Floats  # (p,) of the coordinates and further effects to the optimum at that amplitude
    expected_amplitude: Floats


@dataclass(frozen=True)
class DiscrepancyModel:
    """Covariance of the readings, as the sum of noise, scatter and a smooth discrepancy."""

    covariance: Covariance  # of noise and run-to-run scatter
    process: DiscrepancyProcess

    def of_readings(self, selected: NDArray[np.bool_], run: NDArray[np.int64]) -> DiscrepancyModel:
        """The covariance of the selected readings, of which each has a run (m,)."""
        process = replace(self.process, columns=self.process.columns[selected])
        return DiscrepancyModel(self.covariance.of_readings(selected, run), process)

    @cached_property
    def noise_whitening(self) -> Any:
        """The matrix (m, m) that whitens noise and scatter, sparse: it does not mix runs."""
        from scipy.sparse import csr_array

        return csr_array(self.covariance.whiten)

    @cached_property
    def columns(self) -> Floats:
        """The functions of the process, whitened by noise and scatter, (m, q)."""
        return np.asarray(self.noise_whitening @ self.process.columns)

    @cached_property
    def _factors(self) -> tuple[Floats, Floats]:
        """Orthonormal basis (m, q) of the columns, and their coordinates in it (q, q)."""
        return np.linalg.qr(self.columns)

    @cached_property
    def _divisions(self) -> ProcessDivisions:
        return ProcessDivisions(np.asarray(self.columns.T @ self.columns), self.process.channel)

    def whiten(self, amplitude: Floats) -> Whitening:
        r"""What whitens noise, scatter and a discrepancy of these amplitudes.

        .. math:: W = [I - Q (I - (I + R T^2 R^T)^{-1/2}) Q^T] W_0
        """
        q, r = self._factors
        scaled = r * amplitude[self.process.channel]
        value, vector = np.linalg.eigh(scaled @ scaled.T)
        present = value > 0.0
        shrinkage = 1.0 - 1.0 / np.sqrt(1.0 + value[present])
        return Whitening(self.noise_whitening, q @ vector[:, present], shrinkage)

    def matrix(self, amplitude: Floats) -> Floats:
        """Covariance (m, m) of the readings from noise, scatter and discrepancy."""
        scaled = self.process.columns * amplitude[self.process.channel]
        return np.asarray(self.covariance.matrix + scaled @ scaled.T)

    def evidence(self, fit: Solution, start: Floats | None = None) -> Evidence:
        r"""Evidence of a fit by Laplace's approximation, at the best amplitudes of discrepancy.

        .. math::
            -2 \ln p = r^T V^{-1} r - g^T H^{-1} g + \ln|V| + \ln|H| - 2 \ln p(x) - 2 \ln p(\tau),
            \quad H = X^T V^{-1} X + P

        with the residual r, the Jacobian X and the priors' precision P. The second term is the
        improvement by a step to the optimum under V, where the fit was made under another one.

        start (channels,): Amplitudes at which the search begins.

        References: MacKay, Bayesian Interpolation, Neural Computation 4(3), 1992, section 2.
        """
        problem = linearised(self, fit)
        every = np.arange(len(fit.x) + 1)[None, :]
        (value,), (amplitude,), known = self._best_amplitudes(problem, every, start)
        expected = _expected_amplitude(problem, amplitude, {i: own[0] for i, own in known.items()})
        return replace(_at_amplitude(problem, fit, value, amplitude), expected_amplitude=expected)

    def evidence_with_each(
        self, fit: Solution, extra: Floats, start: Floats | None = None
    ) -> list[Evidence]:
        """Evidence of a fit with each of k further effects alone; see `evidence`.

        The effects are treated as linear.

        extra (m, k): Signatures of the effects, in the readings' unit per reference size.
        """
        problem = linearised(self, fit, extra)
        p, k = len(fit.x), extra.shape[1]
        columns = np.column_stack(
            [np.tile(np.arange(p), (k, 1)), p + np.arange(k), np.full(k, p + k)]
        )
        values, amplitudes, _ = self._best_amplitudes(problem, columns, start)
        return [
            _at_amplitude(problem.of_columns(own), fit, value, amplitude)
            for own, value, amplitude in zip(columns, values, amplitudes, strict=True)
        ]

    def _best_amplitudes(
        self, problem: LinearisedFit, columns: Integers, start: Floats | None
    ) -> tuple[Floats, Floats, dict[int, Floats]]:
        """Evidence (k,) of k models, and amplitudes (k, channels), found channel by channel.

        columns (k, r): Those of each model; see `LinearisedFit.along_each`.

        Returns too the evidence (k, b) along channels, where the others' amplitudes are the final
        ones.
        """
        count = len(self.process.usual)
        amplitude = np.tile(np.zeros(count) if start is None else start, (len(columns), 1))
        values = np.full((len(columns), len(AMPLITUDES)), np.inf)
        known: dict[int, Floats] = {}
        for i in tuple(range(count)) * SWEEPS:
            if i in known:
                continue
            values = np.empty_like(values)
            alike: dict[bytes, list[int]] = {}  # models with the same amplitudes of other channels
            for model, others in enumerate(np.delete(amplitude, i, axis=1)):
                alike.setdefault(others.tobytes(), []).append(model)
            for own in alike.values():
                values[own] = problem.along_each(amplitude[own[0]], i, columns[own])
            best = AMPLITUDES[values.argmin(axis=1)]
            if (best != amplitude[:, i]).any():
                known = {}
            amplitude[:, i], known[i] = best, values
        return values.min(axis=1), amplitude, known


def _at_amplitude(
    problem: LinearisedFit, fit: Solution, value: float, amplitude: Floats
) -> Evidence:
    """Evidence at the best amplitudes; `value` is without bounds and priors of further sizes."""
    product = problem.product(amplitude)
    step, precision = problem.step_and_precision(product)
    for size, own in zip(step[len(fit.x) :], precision[len(fit.x) :], strict=True):
        curvature, _, density = _size_prior(float(size), two_sided=False)
        value += density + float(np.log((own - WEAK_PRECISION + curvature) / own))
    value += outside_bounds(fit, *problem.slope_and_curvature(product))
    return Evidence(float(value), amplitude, step, amplitude)


def linearised(
    discrepancy: DiscrepancyModel, fit: Solution, extra: Floats | None = None
) -> LinearisedFit:
    """A fit's neighbourhood as a linear model, beside a discrepancy.

    extra (m, k): Signatures of further effects, in the readings' unit per reference size.
    """
    whiten = discrepancy.noise_whitening
    added = np.zeros((len(fit.measured), 0)) if extra is None else extra
    jacobian = whiten @ np.column_stack([fit.derivatives, added])
    block = np.column_stack([jacobian, whiten @ (fit.measured - fit.prediction)])
    priors = [_prior(c, float(x)) for c, x in zip(fit.coordinates, fit.x, strict=True)]
    precision = [p for p, _, _ in priors]
    k = added.shape[1]
    deviation, rates = fit.soil_tests.deviation(fit.x), fit.soil_tests.rates(fit.x)
    rates = np.column_stack([rates, np.zeros((len(rates), k))])
    lower = np.asarray([c.lower for c in fit.coordinates])
    upper = np.asarray([c.upper for c in fit.coordinates])
    movable = (fit.x > lower) & (fit.x < upper)
    return LinearisedFit(
        divisions=discrepancy._divisions,
        cross=discrepancy.columns.T @ block,
        plain=block.T @ block,
        precision=np.diag([*precision, *np.full(k, WEAK_PRECISION)]) + rates.T @ rates,
        prior_gradient=np.concatenate([[own for _, own, _ in priors], np.zeros(k)])
        + rates.T @ deviation,
        movable=np.concatenate([movable, np.ones(k, dtype=np.bool_)]),
        constant=sum(constant for _, _, constant in priors) + float(deviation @ deviation),
    )


def _expected_amplitude(
    problem: LinearisedFit, amplitude: Floats, known: Mapping[int, Floats]
) -> Floats:
    """Root mean square of each amplitude over its probability, others at their optimum.

    known: Evidence along channels, where it has been computed.
    """
    found = amplitude.copy()
    for i in range(len(amplitude)):
        values = known[i] if i in known else problem.along(amplitude, i)
        weight = np.exp(-0.5 * TEMPERING * (values - values.min()))
        found[i] = np.sqrt(np.sum(weight * AMPLITUDES**2) / np.sum(weight))
    return found


def _prior(coordinate: Coordinate, x: float) -> tuple[float, float, float]:
    r"""Precision of a coordinate's prior at x, and half the derivative and the value of -2 ln p.

    The value is that of -2 ln p - ln(2 pi), which with ln|H| gives the integral over x. A soil
    coordinate is uniform. A size or shape with a standard deviation is Gaussian. The size of a
    physical effect is scale-free: between `SMALLEST_SIZE` and `LARGEST_SIZE` reference sizes, its
    logarithm is nearly uniform, because effects of a hundredth and of several times their
    reference size occur.
    """
    if not coordinate.effect:
        return UNIFORM_PRECISION, 0.0, 0.0
    if np.isfinite(coordinate.std):
        precision = coordinate.std**-2
        return precision, precision * x, precision * x**2 - float(np.log(precision))
    return _size_prior(x, two_sided=coordinate.lower < 0.0 < coordinate.upper)


def _size_prior(x: float, *, two_sided: bool) -> tuple[float, float, float]:
    r"""As `_prior`, for the density of a size that is 1 / [(|x| + e) ln(1 + X / e)] up to X.

    Beyond X it falls with the third power of the size.
    """
    shifted = abs(x) + SMALLEST_SIZE
    span = float(np.log1p(LARGEST_SIZE / SMALLEST_SIZE)) * (2.0 if two_sided else 1.0)
    value = 2.0 * float(np.log(span * shifted)) - float(np.log(2.0 * np.pi))
    power = 1.0
    if abs(x) > LARGEST_SIZE:
        power += TAIL_POWER
        value += 2.0 * TAIL_POWER * float(np.log(shifted / (LARGEST_SIZE + SMALLEST_SIZE)))
    return power * shifted**-2, power * float(np.sign(x)) / shifted, value


#: Distance from a bound, as a fraction of the prior, at which a coordinate counts as fixed by it.
AT_BOUND = 1e-6
FLAT = 1e-3  # Smallest precision by the likelihood alone: the likelihood is flat over the prior
#: Distance beyond a bound, in standard deviations, from which an asymptotic series is used.
FAR = 6.0


def outside_bounds(fit: Solution, gradient: Floats, curvature: Floats) -> float:
    r"""-2 ln of the factor that the bounds of the soil's priors put on Laplace's approximation.

    Laplace's approximation integrates a normal density over the whole line, with the variance of
    the uniform prior in it. Each soil coordinate t is instead integrated where its prior is:

    .. math:: I = \int_0^1 e^{g (t - x) - \lambda (t - x)^2 / 2} dt

    with the gradient g and the precision lambda of the likelihood at the fit x, all other
    coordinates free. Correlations of these integrals are neglected. An explanation that presses
    the soil against its priors counts for less.

    gradient, curvature (p,), (p, p): Of ln p at the fit, with further effects after the fit's own
        coordinates.
    """
    low = np.asarray([c.lower for c in fit.coordinates])
    high = np.asarray([c.upper for c in fit.coordinates])
    fixed = (fit.x <= low + AT_BOUND) | (fit.x >= high - AT_BOUND)
    movable = np.concatenate([~fixed, np.ones(len(gradient) - len(fixed), dtype=np.bool_)])
    value, inside = 0.0, np.linalg.inv(curvature[np.ix_(movable, movable)])
    for i, c in enumerate(fit.coordinates):
        if c.effect:
            continue
        free, inverse = movable, inside
        if fixed[i]:
            free = movable.copy()
            free[i] = True
            inverse = np.linalg.inv(curvature[np.ix_(free, free)])
        own = int(np.count_nonzero(free[:i]))
        precision = 1.0 / inverse[own, own]
        step = float(inverse[own] @ gradient[free])
        x = float(fit.x[i])
        integral = _log_integral(
            precision * step, max(precision - UNIFORM_PRECISION, FLAT), low[i] - x, high[i] - x
        )
        laplace = 0.5 * log(2.0 * pi / precision) + (0.0 if fixed[i] else 0.5 * precision * step**2)
        value -= 2.0 * (integral - laplace)
    return value


def _log_integral(gradient: float, precision: float, low: float, high: float) -> float:
    """Logarithm of the integral of exp(gradient t - precision t^2 / 2) between two bounds."""
    root = sqrt(precision)
    optimum = gradient / precision
    a, b = (low - optimum) * root, (high - optimum) * root
    if a > 0.0:  # mirrored, so that the bound next to the optimum is the upper one
        a, b, low, high = -b, -a, -high, -low
        gradient = -gradient
    scale = 0.5 * log(2.0 * pi / precision)
    if b >= 0.0:
        share = 0.5 * (erfc(-b / sqrt(2.0)) - erfc(-a / sqrt(2.0)))
        return 0.5 * precision * optimum**2 + scale + log(share)
    at_bound = gradient * high - 0.5 * precision * high**2
    return at_bound + scale + log(_scaled_tail(-b) - _scaled_tail(-a) * exp(0.5 * (b**2 - a**2)))


def _scaled_tail(p: float) -> float:
    """Probability beyond p standard deviations, times exp(p^2 / 2)."""
    if p > FAR:
        return (1.0 - 1.0 / p**2 + 3.0 / p**4) / (p * sqrt(2.0 * pi))
    return 0.5 * erfc(p / sqrt(2.0)) * exp(0.5 * p**2)
