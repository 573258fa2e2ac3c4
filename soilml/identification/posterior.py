"""The prior, and the posterior of the full model by importance sampling, as samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from soilml.arrays import Floats, Integers
from soilml.config.case import Case
from soilml.fitting.coordinates import Coordinate
from soilml.fitting.least_squares import SoilTestTerms, Solution
from soilml.fitting.misfit import declared_misfit, misfit_limit
from soilml.fitting.readings import Readings
from soilml.identification.fit import Fit, with_warnings
from soilml.identification.posterior_density import PosteriorDensity, most_probable
from soilml.identification.posterior_sampling import MOST_SAMPLED_ROWS, sampled
from soilml.numerics.importance_sampling import LEAST_EFFECTIVE_SIZE, ImportanceSample
from soilml.numerics.resampling import latin_hypercube, systematic_resampling
from soilml.quantities import column
from soilml.remarks import Remark

#: Fractions of the posterior below the ends of the 90 % interval.
INTERVAL = np.asarray([0.05, 0.95])
#: Readings from which on the search begins at the optimum: fewer may leave several.
MANY_READINGS = 48
#: Factor on the noise up to which the posterior with the declared noise shows the region.
SIMILAR_NOISE = 2.0
#: Draws of the soil in a result: the standard error of a standard deviation is then 4 %.
STORED_DRAWS = 400
CANDIDATES = 64  # Draws of the priors from which one is chosen by the tests of the soil


@dataclass(frozen=True)
class PosteriorSamples:
    """Weighted samples of the posterior, as fractions of the priors, and the best one's misfit."""

    sample: ImportanceSample
    #: squared residuals over declared variances, per degree of freedom, at the best sample or, with
    #: shared errors and inflated noise, at the optimum
    misfit: float
    #: factor on the declared noise: above 1 where the residuals exceed it significantly
    noise_scale: float

    @property
    def noise_inflated(self) -> bool:
        """Whether the residuals exceed the declared noise."""
        return self.noise_scale > 1.0

    def equally_weighted(self, count: int, seed: int = 0) -> Integers:
        """Rows (count,) of the samples, as often as their weights say."""
        offset = np.random.default_rng(seed).random()
        return systematic_resampling(self.sample.weights, count, offset)


def posterior(case: Case, readings: Readings, free: Sequence[Coordinate]) -> Fit:
    r"""Mean, covariance and 90 % interval of the exact posterior.

    .. math::
        p(\theta | y) \propto p(\theta) \prod_i \frac{1}{\sigma_i(\theta)}
        \exp\left[-\frac{(y_i - f(s_i, W_i; \theta))^2}{2 \sigma_i(\theta)^2}\right]

    Its mean has the least expected squared error of all estimators on data from this model, prior
    and noise. Relative noise is taken relative to the prediction, and noise of slip and load is
    added in quadrature, linearised at the best of the first samples. A model discrepancy is
    integrated out: its covariance is added to that of the noise, and so is that of offsets and
    gains of the sensors that all rows share. Shared errors that the model is solved with (of slip,
    load, bearing and contact) are sampled together with the soil, and left out of the result. A
    parameter that the rows do not determine has its prior as posterior.

    From eight readings on, polynomials of the parameters take the place of the model in the region
    of the posterior. They are used if they change the log density there by at most 0.1 (one
    standard deviation), at points that they were not fitted to; otherwise the model itself is
    sampled, which takes tens of times longer. Parameters that are uniform over several times their
    least value are sampled in their logarithm.

    Where the residuals exceed the declared noise significantly (one data set in a thousand does by
    chance), noise and discrepancy are multiplied by the root of the misfit and the posterior is
    sampled again. This does not correct the bias of a model that lacks an effect.

    Parameters
    ----------
    case
        Model, soil, priors and noise.
    readings
        Rows; the noise of every channel must be declared.
    free
        The p free parameters.

    Returns
    -------
    Fit
        With the ends of the 90 % interval in `low` and `high`.

    Raises
    ------
    FitError
        Where noise is not declared, where the model has no equilibrium at the measured loads for
        any parameters in the prior, or where the effective sample size is below 50.

    References
    ----------
    Tarantola, Inverse Problem Theory, 2005, section 1.5. Cornuet et al., Scandinavian J. Statistics
    39(4), 2012, for the sampling.
    """
    found = posterior_samples(case, readings, free)
    fit, mean_u = fit_of_samples("posterior", found, readings, free)
    return with_warnings(
        fit, case, readings, free, mean_u, excess_residuals=found.noise_inflated, undeclared=False
    )


def fit_of_samples(
    method: str, found: PosteriorSamples, readings: Readings, free: Sequence[Coordinate]
) -> tuple[Fit, Floats]:
    """Mean, covariance and 90 % interval of samples, and the mean (p,) as fractions of priors."""
    sample = found.sample
    values = np.stack([f.prior.at(sample.u[:, i]) for i, f in enumerate(free)], axis=1)
    mean = sample.mean(values)
    deviation = values - mean
    covariance = (deviation.T * sample.weights) @ deviation
    low, high = sample.quantiles(values, INTERVAL)
    mean_u = np.asarray([f.prior.fraction(float(m)) for f, m in zip(free, mean, strict=True)])
    fit = Fit(
        method=method,
        names=tuple(f.path for f in free),
        units=tuple(f.unit for f in free),
        values=mean,
        covariance=covariance,
        warnings=_sampling_warnings(sample),
        rows_used=readings.row_count,
        remaining_fraction={
            f.path: float(np.sqrt(covariance[i, i]) / f.prior.std) for i, f in enumerate(free)
        },
        misfit=found.misfit,
        channels=tuple(column(name) for name in readings.channels),
        low=low,
        high=high,
        samples=found,
        draws=values[found.equally_weighted(STORED_DRAWS)],
    )
    return fit, mean_u


def posterior_samples(
    case: Case, readings: Readings, free: Sequence[Coordinate]
) -> PosteriorSamples:
    """Weighted samples of the posterior, with noise inflated where the residuals require it.

    Raises `FitError` as `posterior` does.
    """
    density, start = PosteriorDensity(case, readings, free), None
    optimum = _optimum(density, case, free)
    # no sample of so many parameters, or of so narrow a part, fits much better than the optimum
    misfit = 0.0 if optimum is None else _misfit(density, optimum.x, len(free))
    limit = misfit_limit(readings.reading_count - len(free))
    if misfit <= limit:
        sample, misfit = _with_misfit(density, optimum, len(free))
        if misfit <= limit:
            return PosteriorSamples(_of_first(sample, len(free)), misfit, 1.0)
        start = sample if misfit < SIMILAR_NOISE**2 else None
    # the samples come near the optimum only: what is stated is the misfit there, as everywhere
    if (at_optimum := declared_misfit(case, readings, free)) and at_optimum.exceeds_noise:
        misfit = min(misfit, at_optimum.per_freedom)
    noise_scale = float(np.sqrt(misfit))
    sample = sampled(PosteriorDensity(case, readings, free, noise_scale), start, optimum)
    return PosteriorSamples(_of_first(sample, len(free)), misfit, noise_scale)


def _of_first(sample: ImportanceSample, p: int) -> ImportanceSample:
    """The same samples of the first p parameters alone."""
    return replace(sample, u=sample.u[:, :p])


def sample_posterior(
    case: Case, readings: Readings, free: Sequence[Coordinate]
) -> tuple[ImportanceSample, float]:
    """Weighted fractions of the priors under the noise as declared, and the misfit.

    Those of shared errors stand behind. Raises `FitError` as `posterior` does.
    """
    density = PosteriorDensity(case, readings, free)
    return _with_misfit(density, _optimum(density, case, free), len(free))


def _optimum(density: PosteriorDensity, case: Case, free: Sequence[Coordinate]) -> Solution | None:
    """The most probable parameters, where a search from there is quicker than one of the priors."""
    readings = density.readings
    few, many = readings.reading_count < MANY_READINGS, len(readings.row_slip) > MOST_SAMPLED_ROWS
    if not density.errors and (few or many):
        return None
    return most_probable(case, readings, free)


def _with_misfit(
    density: PosteriorDensity, optimum: Solution | None, parameters: int
) -> tuple[ImportanceSample, float]:
    """Weighted fractions of the priors, with those of shared errors behind, and the misfit.

    The noise is as declared. The misfit is that at the sample of largest weight, or with shared
    errors at the optimum if it is less there.
    """
    sample = sampled(density, None, optimum)
    misfit = _misfit(density, sample.u[int(np.argmax(sample.weights))], parameters)
    if optimum is not None:  # samples have nearly one more squared residual for each error
        misfit = min(misfit, _misfit(density, optimum.x, parameters))
    return sample, misfit


def _misfit(density: PosteriorDensity, u: Floats, parameters: int) -> float:
    """Squared residuals over declared variances, per degree of freedom, at fractions u (p,).

    With a discrepancy, or errors that all rows share, weighted by the inverse covariance.
    """
    cost = density.squared_residuals(u[None, :]) + density.readings.squares_within
    return cost / max(density.readings.reading_count - parameters, 1)


def _sampling_warnings(sample: ImportanceSample) -> tuple[Remark, ...]:
    size = sample.effective_size
    if size >= 0.5 * LEAST_EFFECTIVE_SIZE:
        return ()
    text = f"the effective sample size is {size:.0f} only: sampling error of the values is about "
    return (Remark("few-samples", f"{text}{100 / np.sqrt(size):.0f} % of their std"),)


def prior_fractions(
    free: Sequence[Coordinate], count: int, rng: np.random.Generator, case: Case | None = None
) -> Floats:
    """Fractions (count, p) of the priors by Latin hypercube; tests of the case's soil take part.

    With tests, draws are chosen with probabilities in proportion to their density.
    """
    if case is None or not case.soil_tests:
        return latin_hypercube(count, len(free), rng)
    u = latin_hypercube(CANDIDATES * count, len(free), rng)
    logs = -0.5 * (SoilTestTerms(case, free).deviation(u) ** 2).sum(axis=1)
    weights = np.exp(logs - logs.max())
    chosen = systematic_resampling(weights / weights.sum(), count, rng.random())
    return np.asarray(u[rng.permutation(chosen)])
