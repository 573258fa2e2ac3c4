"""The exact posterior of a simulated set: the wheel's own physics and the set's true noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri
from scipy.stats import qmc

from soilml.numerics.importance_sampling import ImportanceSample, importance_sample
from soilml.numerics.quantiles import systematic_resampling
from soilml.onboard.set_contract import ABSENT_STD, RESPONSE_CHANNELS
from training.set_posterior.families.coordinates import NORMAL_TRUNCATION
from training.set_posterior.families.wheel_family import SimulatedSets, WheelFamily
from training.set_posterior.monomials import monomial_terms, monomials

Floats = NDArray[np.float64]

#: A posterior of fewer effective samples is flagged: the Monte Carlo error of its mean exceeds
#: 1 / sqrt(400) = 0.05 of its standard deviation.
MIN_EFFECTIVE_SAMPLES = 400.0


#: Quantiles of a posterior: ends of the 90 % and of the 50 % interval.
FRACTIONS = (0.05, 0.25, 0.75, 0.95)


@dataclass(frozen=True)
class ExactPosterior:
    """The posterior of the estimated parameters of one set."""

    mean: Floats  # (q,)
    covariance: Floats  # (q, q)
    quantiles: Floats  # (4, q) at FRACTIONS
    flagged: bool  # whether sampling or its surrogate failed
    log_evidence: float


@dataclass(frozen=True)
class Unknowns:
    """The unknowns of one set, as fractions u (n, p) of their priors."""

    family: WheelFamily
    near: float
    scale: Floats  # (q,) by which the values of the estimated axes are multiplied

    @staticmethod
    def of(family: WheelFamily, sets: SimulatedSets, index: int) -> Unknowns:
        """The unknowns of a simulated set."""
        context = sets.context_of(index)
        upper_ends = [f"{axis.name}_max" for axis in family.axes[: family.targets]]
        scale = np.asarray([context.get(name, 1.0) for name in upper_ends])
        return Unknowns(family, float(sets.normal_std[index]), scale)

    @property
    def count(self) -> int:
        """Number of unknowns; without it the nearly known axes where they are exactly known."""
        return len(self.family.axes) if self.near > 0.0 else self.family.free

    def x(self, u: Floats) -> Floats:
        """Coordinates (n, all axes)."""
        free = self.family.free
        x = np.zeros((len(u), len(self.family.axes)))
        for i, axis in enumerate(self.family.axes[:free]):
            x[:, i] = axis.quantile(u[:, i])
        if self.near > 0.0:  # a normal prior, truncated at NORMAL_TRUNCATION standard deviations
            low, high = ndtr(-NORMAL_TRUNCATION), ndtr(NORMAL_TRUNCATION)
            x[:, free:] = self.near * ndtri(low + (high - low) * u[:, free:])
        return x

    def values(self, x: Floats) -> Floats:
        """Estimated parameters (n, q) at coordinates."""
        axes = self.family.axes[: self.family.targets]
        return np.stack([axis.value(x[:, i]) for i, axis in enumerate(axes)], axis=1) * self.scale


def sample_posterior(
    unknowns: Unknowns, log_likelihood: Callable[[Floats], Floats]
) -> tuple[ExactPosterior, ImportanceSample]:
    """The posterior under a log likelihood of coordinates (n, axes)."""
    sample = importance_sample(lambda u: log_likelihood(unknowns.x(u)), unknowns.count)
    values = unknowns.values(unknowns.x(sample.u))
    mean = sample.mean(values)
    deviation = values - mean
    summary = ExactPosterior(
        mean=mean,
        covariance=(deviation.T * sample.weights) @ deviation,
        quantiles=sample.quantiles(values, np.asarray(FRACTIONS)),
        flagged=sample.effective_size < MIN_EFFECTIVE_SAMPLES,
        log_evidence=sample.evidence,
    )
    return summary, sample


#: Total degree of the polynomial surrogate, by the number of unknowns: as high as keeps the number
#: of terms, and so of physics evaluations, below some hundreds.
DEGREES = {1: 10, 2: 8, 3: 6, 4: 5, 5: 5}
#: Fitting points per term of the polynomial, and posterior draws that it is verified at.
POINTS_PER_TERM, CHECK_POINTS = 2.0, 32
#: A set is flagged where the rms error of its surrogate exceeds this share of the reading noise.
TOLERANCE = 0.05
#: Points per evaluation of the physics, which bounds its memory.
BATCH = 4096


def exact_set_posterior(family: WheelFamily, sets: SimulatedSets, index: int) -> ExactPosterior:
    r"""The posterior of one set, by the importance sampler of the analytic `posterior` method.

    The likelihood has the noise that the set was simulated with: proportional to the *true* value,
    not to its reading. With T_i(x) the torques of the wheel's physics, sigma_i their noise, and
    tau_i the standard deviation of the bias that all rows share,

    .. math:: r_i = \frac{y_i - T_i}{\sigma_i}, \quad g_i = \frac{\tau_i}{\sigma_i}, \qquad
        \log p(y | x) = -\frac12 \left(r^T r - \frac{(g^T r)^2}{1 + g^T g}\right)
        - \sum_i \log \sigma_i - \frac12 \log(1 + g^T g)

    The physics is replaced by a polynomial of the unknowns, fitted to this set alone and verified
    at posterior draws; the set is flagged where the error exceeds `TOLERANCE`. Where some soils of
    the prior do not carry the load, no polynomial fits, and the physics itself is evaluated.
    """
    unknowns = Unknowns.of(family, sets, index)
    designs, truth = sets.designs[index], sets.x[index]

    def physics(x: Floats) -> Floats:
        batches = np.split(x, range(BATCH, len(x), BATCH))
        return np.concatenate([family.responses(designs, batch[None]) for batch in batches], axis=1)

    surrogate = _fit_surrogate(unknowns, designs)
    likelihood = log_likelihood(sets, index, surrogate or physics)
    summary, sample = sample_posterior(unknowns, likelihood)
    if surrogate is None:
        return summary
    x = np.vstack(
        [truth, unknowns.x(sample.u[systematic_resampling(sample.weights, CHECK_POINTS, 0.5)])]
    )
    error = _rms_error_over_noise(sets, index, surrogate(x), physics(x))
    return replace(summary, flagged=summary.flagged or not error < TOLERANCE)


def log_likelihood(
    sets: SimulatedSets, index: int, response: Callable[[Floats], Floats]
) -> Callable[[Floats], Floats]:
    """Log likelihood (n,) of a set's readings at coordinates (n, axes), -inf without equilibrium.

    `response` gives channels (rows, n, 3) as `WheelFamily.answers` does. The factor
    (2 pi)^(-k / 2) of k readings is left out.
    """
    rows = sets.rows(index)

    def evaluate(x: Floats) -> Floats:
        values = si_values(sets, index, response(x))
        total = np.zeros(values.shape[1])
        for k, name in enumerate(RESPONSE_CHANNELS):
            read = rows[f"{name}_std"] < ABSENT_STD
            if not read.any():
                continue
            value, y = values[read, :, k], rows[name][read, None]
            std = _noise_std(sets, index, name, read, value)
            r = (y - value) / std
            total -= np.log(std).sum(axis=0) + 0.5 * (r**2).sum(axis=0)
            if name == "torque":
                g = _noise_std(sets, index, "torque_bias", read, value) / std
                size = 1.0 + (g**2).sum(axis=0)
                total += 0.5 * ((g * r).sum(axis=0) ** 2 / size - np.log(size))
        return np.where(np.isfinite(total), total, -np.inf)

    return evaluate


def si_values(sets: SimulatedSets, index: int, y: Floats) -> Floats:
    """Torque, sinkage and drawbar pull (rows, n, 3) in SI units from a family's channels."""
    length, load = sets.length[index], sets.rows(index)["load"][:, None]
    with np.errstate(over="ignore"):
        return np.stack(
            [np.exp(y[..., 0]) * load * length, np.exp(y[..., 1]) * length, y[..., 2] * load],
            axis=-1,
        )


def _noise_std(
    sets: SimulatedSets, index: int, name: str, read: NDArray[np.bool_], value: Floats
) -> Floats:
    """Noise of values (rows, n); zero where the sets have none of this name."""
    if name not in sets.noise:
        return np.zeros_like(value)
    constant, share = (part[index][read, None] for part in sets.noise[name])
    return np.asarray(np.hypot(constant, share * value))


def _fit_surrogate(unknowns: Unknowns, designs: Floats) -> Callable[[Floats], Floats] | None:
    """Channels (rows, n, 3) as polynomials of coordinates; None where a soil carries no load."""
    family, p = unknowns.family, unknowns.count
    these = monomial_terms(p, DEGREES[p])
    half_width = np.ones(p)
    if p > family.free:
        half_width[family.free :] = NORMAL_TRUNCATION * unknowns.near
    count = int(POINTS_PER_TERM * len(these))
    u = qmc.Sobol(p, rng=1).random(1 << (count - 1).bit_length())[:count]
    nodes = -np.cos(np.pi * u)  # arcsine density: denser at the ends, as Chebyshev nodes are
    x = np.zeros((count, len(family.axes)))
    x[:, :p] = nodes * half_width
    y = family.responses(designs, x[None])
    if not np.isfinite(y).all():
        return None
    coefficients = np.linalg.pinv(monomials(nodes, these)) @ y

    def response(x: Floats) -> Floats:
        return np.asarray(monomials(x[:, :p] / half_width, these) @ coefficients)

    return response


def _rms_error_over_noise(sets: SimulatedSets, index: int, y: Floats, true: Floats) -> float:
    """Rms difference of two responses over the noise, of the channels that are read."""
    a, b = si_values(sets, index, y), si_values(sets, index, true)
    rows, squares = sets.rows(index), []
    for k, name in enumerate(RESPONSE_CHANNELS):
        read = rows[f"{name}_std"] < ABSENT_STD
        if read.any():
            std = _noise_std(sets, index, name, read, b[read, :, k])
            squares.append(((a[read, :, k] - b[read, :, k]) / std) ** 2)
    return float(np.sqrt(np.mean(np.concatenate(squares))))


def posterior_of_memory(
    family: WheelFamily, system: Floats, sets: SimulatedSets, index: int
) -> ExactPosterior:
    r"""The posterior of a linear system (m, terms + errors), as in `SetPosterior`, well sampled.

    .. math:: \log p(y | x) = -\tfrac12 | S^{-1} A b(x) |^2 + const, \qquad I + G G^T = S S^T

    with the last columns G the effects of errors that all readings share. They are integrated out
    by the update of Andrews (AIAA Journal 6(6), 1968), with the Cholesky factor
    :math:`I + G^T G = L L^T`:

    .. math:: A' = A - G (L + I)^{-T} L^{-1} G^T A

    The estimate of a file differs from it
    by the Monte Carlo error of its short sampling alone. Its difference from the exact posterior is
    the error of the learned response, and of a likelihood that is normal in the logarithm of a
    reading.
    """
    axes, (degree, of_targets) = len(family.axes), family.degree
    these = monomial_terms(axes, degree, family.targets, of_targets)
    a, g = np.split(system, [len(these)], axis=1)
    identity = np.eye(g.shape[1])
    factor = np.linalg.cholesky(identity + g.T @ g)
    a = a - g @ np.linalg.solve((factor + identity).T, np.linalg.solve(factor, g.T @ a))

    def log_likelihood(x: Floats) -> Floats:
        return np.asarray(-0.5 * ((monomials(x, these) @ a.T) ** 2).sum(axis=1))

    return sample_posterior(Unknowns.of(family, sets, index), log_likelihood)[0]
