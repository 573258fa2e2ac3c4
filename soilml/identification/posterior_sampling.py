"""Samples of the posterior of soil and shared errors."""

from __future__ import annotations

import numpy as np

from soilml.arrays import Floats
from soilml.errors import FitError
from soilml.fitting.coordinates import log_ratios
from soilml.fitting.least_squares import Solution
from soilml.fitting.uncarried_loads import raise_uncarried
from soilml.identification.posterior_density import PosteriorDensity
from soilml.numerics.importance_sampling import ImportanceSample, importance_sample
from soilml.numerics.surface_sampling import MOST_ROUNDS, normal_sample, surface_sample
from soilml.numerics.surrogate_density import LogarithmicDensity, SamplingBox

#: Effective sample size below which mean and spread of the samples are not reported: their errors
#: then exceed 1 / sqrt(50) = 14 % of the standard deviation.
LEAST_USABLE_SIZE = 50.0
#: Readings from which on polynomials take the place of the model: few readings may leave a region
#: with edges, and need few evaluations.
FEWEST_READINGS = 8
#: Rows from which on a part of them, of the second number, is sampled first.
MANY_ROWS, FIRST_ROWS = 512, 256
#: Largest standard deviation, in fractions of the priors, of a posterior that is narrow; where the
#: model itself is sampled, its first samples spread so much more than the linearised one.
NARROW, MUCH_WIDER = 0.15, 1.6
SMALL_ROUND = 1024  # Samples of a round then
#: Rows from which on polynomials are tried beside shared errors, which take longer with fewer, and
#: rounds after which they must be accurate enough for the density itself.
FEWEST_ROWS, TEMPERED_ROUNDS = 32, 2
#: Factor on the noise from which on rows are explained by neither soil nor errors, and most rounds
#: then: an answer that nobody should believe takes little time.
UNEXPLAINED, FEW_ROUNDS = 2.0, 4
#: Standard deviations from the middle at which the region ends in which the model is sampled.
REACH = 6.0
MOST_SAMPLED_ROWS = 128  # Most rows where the model is sampled, which bounds the time
#: Effective sample size at which sampling of the model ends, and the numbers of solutions and of
#: samples at which it ends anyway where nothing explains the rows.
ENOUGH, MOST_SOLUTIONS, FEWEST_SAMPLES = 1250.0, 500_000, 4096


def sampled(
    density: PosteriorDensity,
    start: ImportanceSample | None = None,
    optimum: Solution | None = None,
) -> ImportanceSample:
    """Weighted fractions (n, p) of the priors, those of shared errors behind.

    Samples of a similar posterior, `start`, show the region, or the optimum does. Parameters that
    are uniform over several times their least value are sampled in their logarithm.

    Raises `FitError` where no parameters in the prior carry the measured loads, or where the
    effective sample size is below 50.
    """
    logs = in_logarithms(density)
    sample: ImportanceSample | None = None
    if optimum is not None:
        sample = (_beside_errors if density.errors else _about_optimum)(density, optimum)
    if sample is None:
        sample = _from_surface(density, None if start is None else logs.forth(start))
    if sample is None:
        sample = importance_sample(logs, len(density.free))
    if not np.isfinite(sample.evidence):
        raise_uncarried(density.case, density.readings.at)
    if sample.effective_size < LEAST_USABLE_SIZE:
        raise FitError(
            f"the effective sample size is {sample.effective_size:.0f}, too small for a mean and a "
            f"spread ({LEAST_USABLE_SIZE:.0f} needed): the posterior is too narrow a part of the "
            "prior; use --method nonlinear, or narrow [soil.prior]"
        )
    return logs.back(sample)


def in_logarithms(density: PosteriorDensity) -> LogarithmicDensity:
    """The density in the logarithms of parameters that are uniform over several times their least.

    In ratios of bearing moduli and the exponent the posterior is bent; in logarithms it is not.
    """
    return LogarithmicDensity(density, log_ratios(density.free))


def _beside_errors(density: PosteriorDensity, optimum: Solution) -> ImportanceSample:
    """Samples of soil and shared errors.

    The region is that of the linearised posterior at the most probable parameters. Polynomials take
    the place of the model where they soon turn out to be accurate there; otherwise the model is
    sampled, of many rows at some that are chosen at random; where nothing explains the rows, for a
    bounded number of solutions.
    """
    logs = in_logarithms(density)
    start = normal_sample(*logs.around(optimum.x, normal_root(density, optimum)))
    density.linearise_at_mean(logs.back(start))
    rows, p = len(density.readings.row_slip), len(density.free)
    if rows >= FEWEST_ROWS:
        most = FEW_ROUNDS if density.noise_scale > UNEXPLAINED else MOST_ROUNDS
        found = surface_sample(logs, p, start, tempered_rounds=TEMPERED_ROUNDS, most_rounds=most)
        if found is not None and density.linearise_at_mean(logs.back(found)):
            found = surface_sample(logs, p, found)
        if found is not None:
            return found
    if rows > MOST_SAMPLED_ROWS:
        chosen = np.random.default_rng(0).permutation(rows)[:MOST_SAMPLED_ROWS]
        logs = in_logarithms(density.of_rows(np.sort(chosen)))
    return of_model(logs, start, density.noise_scale, len(density.readings.row_slip))


def _about_optimum(density: PosteriorDensity, optimum: Solution) -> ImportanceSample | None:
    """Samples of soil from the optimum on; None where polynomials fail and much of the prior is it.

    Of a narrow posterior, polynomials take the place of the model. A wide one may go on beyond
    their region, and the model itself is sampled from theirs on.
    """
    root = normal_root(density, optimum)
    narrow = float(np.sqrt((root**2).sum(axis=1)).max()) <= NARROW
    logs = in_logarithms(density)
    middle, own_root = logs.around(optimum.x, root)
    start = normal_sample(middle, own_root)
    density.linearise_at_mean(logs.back(start))
    found = surface_sample(logs, len(root), start)
    if found is not None and density.linearise_at_mean(logs.back(found)):
        found = surface_sample(logs, len(root), found)
    if found is not None and not narrow:
        return importance_sample(
            logs, len(root), around=found, later=SMALL_ROUND, least_effective_size=ENOUGH
        )
    if found is None and narrow:
        around = middle, MUCH_WIDER * own_root
        return importance_sample(logs, len(root), around=around, later=SMALL_ROUND)
    return found


def _from_surface(
    density: PosteriorDensity, start: ImportanceSample | None = None
) -> ImportanceSample | None:
    """Samples with polynomials in place of the model, or None where these do not serve.

    Of many rows, a part shows the region in which all are evaluated.
    """
    readings, p, logs = density.readings, len(density.free), in_logarithms(density)
    if readings.reading_count < FEWEST_READINGS:
        return None
    if start is None and len(readings.row_slip) > MANY_ROWS:
        part = np.random.default_rng(0).permutation(len(readings.row_slip))[:FIRST_ROWS]
        start = _from_surface(density.of_rows(np.sort(part)))
    sample = surface_sample(logs, p, start)
    if sample is None and start is not None:  # it may have shown the wrong region
        sample = surface_sample(logs, p)
    if sample is not None and density.linearise_at_mean(logs.back(sample)):
        sample = surface_sample(logs, p, sample)
    return sample


def normal_root(density: PosteriorDensity, optimum: Solution) -> Floats:
    """A root (p, p) of the covariance of the linearised posterior, in fractions of the priors."""
    precision = optimum.jacobian.T @ optimum.jacobian / density.noise_scale**2
    prior = np.diag([f.fraction_precision for f in density.free])
    of_tests = optimum.soil_tests.rates(optimum.x)
    prior += of_tests.T @ of_tests
    return np.linalg.cholesky(np.linalg.inv(precision + prior))


def of_model(
    density: LogarithmicDensity, start: ImportanceSample, noise_scale: float, rows: int
) -> ImportanceSample:
    """Samples of the density itself, in a box about those of a similar one."""
    region = SamplingBox.of(start, REACH)

    def log_density(fractions: Floats) -> Floats:
        u = region.points(fractions)
        inside = np.all((u > 0.0) & (u < 1.0), axis=1)
        logs = np.full(len(u), -np.inf)
        logs[inside] = density(u[inside])
        return logs

    most = float("inf")
    if noise_scale > UNEXPLAINED:
        most = max(MOST_SOLUTIONS // rows, FEWEST_SAMPLES)
    found = importance_sample(
        log_density,
        start.u.shape[1],
        least_effective_size=ENOUGH,
        around=region.middle,
        most_samples=most,
    )
    kept = found.weights > 0.0
    u, weights = region.points(found.u[kept]), found.weights[kept]
    return ImportanceSample(u, weights, found.evidence + region.log_volume)
