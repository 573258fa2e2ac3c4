"""The prior, and the posterior of the full model by importance sampling, as samples."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from soilml.arrays import Floats, Integers
from soilml.config.case import Case
from soilml.errors import FitError
from soilml.fitting.coordinates import Coordinate, values_at
from soilml.fitting.covariance import noise_of_operation, squared_residuals_and_log_determinant
from soilml.fitting.damped_descents import EXACT, descend
from soilml.fitting.global_optimum import raise_uncarried
from soilml.fitting.least_squares import LeastSquaresProblem, SoilTestTerms, Solution
from soilml.fitting.misfit import Misfit, columns_of_errors, fit_under_declared_noise
from soilml.fitting.readings import Readings
from soilml.identification.fit import WIDENED, Fit, SoilExplanation, with_warnings
from soilml.numerics.importance_sampling import ImportanceSample, importance_sample
from soilml.numerics.quantiles import latin_hypercube, systematic_resampling
from soilml.quantities import column
from soilml.remarks import Remark

#: Fractions of the posterior below the ends of the 90 % interval.
INTERVAL = np.asarray([0.05, 0.95])
#: Readings below which the whole prior is sampled: few readings may leave a region with edges.
FEW_READINGS = 9
#: Of more readings, samples begin with the linearised posterior, so much wider; samples of a round,
#: effective size at which sampling ends, and most samples.
WIDER, ROUND, ENOUGH, MOST_SAMPLES = 1.5, 1024, 1250.0, 16_384
#: Effective sample size below which mean and spread of the samples are not reported: their errors
#: then exceed 1 / sqrt(50) = 14 % of the standard deviation.
LEAST_USABLE_SIZE = 50.0
FEW_SAMPLES = 200.0  # Effective sample size below which a remark states the sampling error
MOST_EVALUATIONS = 200_000  # Most model evaluations in one call, which bounds memory
#: Draws of the soil in a result: the standard error of a standard deviation is then 4 %.
STORED_DRAWS = 400
CANDIDATES = 64  # Draws of the priors from which one is chosen by the tests of the soil


@dataclass(frozen=True)
class PosteriorSamples:
    """Weighted samples of the soil, as fractions of the priors."""

    sample: ImportanceSample
    #: Squared residuals of the best fit in variances of the declared noise, per degree of freedom
    misfit: float
    rejected: bool  # Whether the rows reject the model with all errors that the method knows
    #: Factor on the declared noise: above 1 where the rows reject the model
    noise_scale: float = 1.0
    explanations: tuple[SoilExplanation, ...] = ()  # That they average over, the likeliest first

    def equally_weighted(self, count: int) -> Integers:
        """Rows (count,) of the samples, as often as their weights say."""
        offset = np.random.default_rng(0).random()
        return systematic_resampling(self.sample.weights, count, offset)


def posterior(case: Case, readings: Readings, free: Sequence[Coordinate]) -> Fit:
    r"""Mean, covariance and 90 % interval of the exact posterior.

    .. math::
        p(\theta | y) \propto p(\theta) \prod_i \frac{1}{\sigma_i(\theta)}
        \exp\left[-\frac{(y_i - f(s_i, W_i; \theta))^2}{2 \sigma_i(\theta)^2}\right]

    Its mean has the least expected squared error of all estimators on data from this model, prior
    and noise. Relative noise is taken relative to the prediction, and noise of slip and load is
    added in quadrature, linearised at the best of the first samples. A model discrepancy is
    integrated out: its covariance is added to that of the noise, and so is that of errors of the
    sensors that all rows share, linearised at the optimum. A parameter that the rows do not
    determine has its prior as posterior.

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
    excess = WIDENED if found.rejected else ""
    return fit_of_samples("posterior", found, case, readings, free, excess)


def fit_of_samples(
    method: str,
    found: PosteriorSamples,
    case: Case,
    readings: Readings,
    free: Sequence[Coordinate],
    excess_residuals: str,
) -> Fit:
    """Mean, covariance and 90 % interval of samples, with warnings; see `with_warnings`."""
    sample = found.sample
    values = np.stack([f.prior.at(sample.u[:, i]) for i, f in enumerate(free)], axis=1)
    mean = sample.mean(values)
    deviation = values - mean
    covariance = (deviation.T * sample.weights) @ deviation
    low, high = sample.quantiles(values, INTERVAL)
    mean_u = np.asarray([f.prior.fraction(float(m)) for f, m in zip(free, mean, strict=True)])
    size = sample.effective_size
    few = f"the effective sample size is {size:.0f} only: sampling error of the values is about "
    few += f"{100 / np.sqrt(size):.0f} % of their std"
    fit = Fit(
        method=method,
        names=tuple(f.path for f in free),
        units=tuple(f.unit for f in free),
        values=mean,
        covariance=covariance,
        warnings=(Remark("few-samples", few),) if size < FEW_SAMPLES else (),
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
        explanations=found.explanations,
    )
    return with_warnings(fit, case, readings, free, mean_u, excess_residuals)


def posterior_samples(
    case: Case, readings: Readings, free: Sequence[Coordinate]
) -> PosteriorSamples:
    """Weighted samples of the posterior, with noise inflated where the residuals require it.

    Raises `FitError` as `posterior` does.
    """
    check_declared(readings)
    optimum = fit_under_declared_noise(case, readings, free)
    found = Misfit.of(optimum)
    scale = found.factor if found.exceeds_noise else 1.0
    sample = sample_posterior(optimum, scale)
    return PosteriorSamples(sample, found.per_freedom, found.exceeds_noise, scale)


def sample_posterior(optimum: Solution, noise_scale: float = 1.0) -> ImportanceSample:
    """Weighted fractions of the priors, under the declared noise times a factor.

    optimum: That of `fit_under_declared_noise`.

    Raises `FitError` as `posterior` does.
    """
    problem, p = optimum.problem, len(optimum.x)
    density = posterior_density(problem, optimum.x, noise_scale)
    if len(problem.readings) < FEW_READINGS:
        sample = importance_sample(density, p, most_samples=MOST_SAMPLES)
    else:
        best = descend(replace(problem, priors="all"), optimum.x, EXACT, optimum.linearisation)
        rates = best.soil_tests.rates(best.x)
        precision = best.jacobian.T @ best.jacobian / noise_scale**2 + rates.T @ rates
        precision += np.diag([c.fraction_precision for c in best.coordinates])
        sample = importance_sample(
            density,
            p,
            around=(best.x, WIDER * np.linalg.cholesky(np.linalg.inv(precision))),
            least_effective_size=ENOUGH,
            most_samples=MOST_SAMPLES,
            later=ROUND,
        )
    if not np.isfinite(sample.evidence):
        raise_uncarried(problem.case, problem.readings.at)
    if sample.effective_size < LEAST_USABLE_SIZE:
        raise FitError(
            f"the effective sample size is {sample.effective_size:.0f}, too small for a mean and a "
            f"spread ({LEAST_USABLE_SIZE:.0f} needed): the posterior is too narrow a part of the "
            "prior; use --method nonlinear, or narrow [soil.prior]"
        )
    return sample


def posterior_density(
    problem: LeastSquaresProblem, optimum: Floats, noise_scale: float = 1.0
) -> Callable[[Floats], Floats]:
    """Log posterior density (sets,), up to a constant, of fractions u (sets, p) of the priors.

    It is -inf without an equilibrium. Model discrepancy and errors that all rows share are
    integrated out, linearised at the optimum; so is noise of slip and load.

    problem: Readings with the noise that they have at the optimum, and the case.
    optimum (p,): Fractions of the priors at the optimum.
    noise_scale: Factor on all noise: above 1 where residuals exceed all that is declared.
    """
    readings, names = problem.readings, [c.path for c in problem.coordinates]
    values = map(float, values_at(problem.coordinates, optimum))
    soil = problem.case.with_values(dict(zip(names, values, strict=True)))
    operation, columns = noise_of_operation(soil, readings), columns_of_errors(soil, readings)

    def of(u: Floats) -> Floats:
        y = problem.predict(u)
        std = np.hypot(readings.noise_at(y), operation)
        squares, log_determinant = squared_residuals_and_log_determinant(
            y - readings.measured, std, columns
        )
        # the factor on all noise enters the determinant as a constant, which does not matter
        logs = -0.5 * squares / noise_scale**2 - log_determinant
        logs -= 0.5 * (problem.soil_tests.deviation(u) ** 2).sum(axis=1)
        return np.where(np.isfinite(logs), logs, -np.inf)

    size = max(MOST_EVALUATIONS // readings.row_count, 1)
    return lambda u: np.concatenate([of(u[i : i + size]) for i in range(0, len(u), size)])


def check_declared(readings: Readings) -> None:
    """Raise `FitError` where the noise of a channel is not declared, with what to write."""
    if undeclared := readings.undeclared:
        lines = ", ".join(f"{name} = '3 %'" for name in undeclared)
        raise FitError(
            f"the posterior method needs the noise of {', '.join(undeclared)}: declare it in "
            f"[noise] of the model file, such as {lines}"
        )


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
