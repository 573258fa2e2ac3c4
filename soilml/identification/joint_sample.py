"""Samples of soil and shared errors together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.fitting.coordinates import Coordinate
from soilml.fitting.least_squares import Solution
from soilml.fitting.readings import Readings
from soilml.fitting.starts import descend, global_optimum
from soilml.identification.nonlinear import WeightedRows
from soilml.identification.posterior_density import PosteriorDensity
from soilml.numerics.importance_sampling import ImportanceSample, importance_sample
from soilml.numerics.surface_sampling import MOST_ROUNDS, surface_sample
from soilml.numerics.surrogate_density import SamplingBox

Floats = NDArray[np.float64]

#: Samples of the normal distribution, and their spread over that of the linearised posterior.
SAMPLES, WIDER = 2048, 1.2
#: Rows from which on polynomials are tried in the place of the model, which take longer with fewer,
#: and rounds after which they must be accurate enough for the density itself.
FEWEST_ROWS, TEMPERED_ROUNDS = 32, 2
#: Factor on the noise from which on rows are explained by neither soil nor errors, and most rounds
#: then: an answer that nobody should believe takes little time.
UNEXPLAINED, FEW_ROUNDS = 2.0, 4
#: Standard deviations from the middle at which the region ends in which the model is sampled.
REACH = 6.0
#: Most rows where the model is sampled, which bounds the time.
MOST_SAMPLED_ROWS = 128
#: Effective sample size at which sampling of the model ends, and the numbers of solutions and of
#: samples at which it ends anyway where nothing explains the rows.
ENOUGH, MOST_SOLUTIONS, FEWEST_SAMPLES = 1250.0, 500_000, 4096


def joint_sample(density: PosteriorDensity, optimum: Solution) -> ImportanceSample:
    """Weighted fractions (n, p) of the priors of soil and errors.

    The region is that of the linearised posterior at the most probable parameters. Polynomials take
    the place of the model where they soon turn out to be accurate there; otherwise the model is
    sampled, of many rows at some that are chosen at random; where nothing explains the rows, for a
    bounded number of solutions.
    """
    start = normal_start(density, optimum)
    density.linearise_at_mean(start)
    rows, p = len(density.readings.row_slip), len(density.free)
    if rows >= FEWEST_ROWS:
        most = FEW_ROUNDS if density.noise_scale > UNEXPLAINED else MOST_ROUNDS
        found = surface_sample(density, p, start, tempered_rounds=TEMPERED_ROUNDS, most_rounds=most)
        if found is not None and density.linearise_at_mean(found):
            found = surface_sample(density, p, found)
        if found is not None:
            return found
    if rows > MOST_SAMPLED_ROWS:
        chosen = np.random.default_rng(0).permutation(rows)[:MOST_SAMPLED_ROWS]
        density = density.of_rows(np.sort(chosen))
    return _of_model(density, start)


def most_probable(case: Case, readings: Readings, free: Sequence[Coordinate]) -> Solution:
    """The most probable parameters and errors, with normal priors of the same variances.

    Raises `FitError` where the model has no equilibrium at the measured loads.
    """
    weighted = WeightedRows.of(case, readings, free)
    optimum = global_optimum(weighted.problem, weighted.of_few_rows().problem)
    return descend(weighted.with_noise_at(optimum).problem, optimum.x, with_prior=True)


def normal_start(density: PosteriorDensity, optimum: Solution) -> ImportanceSample:
    """Samples of the linearised posterior about the most probable parameters, of equal weights."""
    precision = optimum.jacobian.T @ optimum.jacobian / density.noise_scale**2
    prior = np.diag([f.fraction_precision for f in density.free])
    of_tests = optimum.soil_tests.rates(optimum.x)
    prior += of_tests.T @ of_tests
    root = np.linalg.cholesky(np.linalg.inv(precision + prior))
    normal = np.random.default_rng(0).standard_normal((SAMPLES, len(optimum.x)))
    u = optimum.x + WIDER * normal @ root.T
    u = np.clip(1.0 - np.abs(1.0 - np.abs(u)), 1e-6, 1.0 - 1e-6)  # reflected at the faces
    return ImportanceSample(u, np.full(SAMPLES, 1.0 / SAMPLES), 0.0)


def _of_model(density: PosteriorDensity, start: ImportanceSample) -> ImportanceSample:
    """Samples of the density itself, in a box about those of a similar one."""
    region = SamplingBox.of(start, REACH)

    def log_density(fractions: Floats) -> Floats:
        u = region.points(fractions)
        inside = np.all((u > 0.0) & (u < 1.0), axis=1)
        logs = np.full(len(u), -np.inf)
        logs[inside] = density(u[inside])
        return logs

    p, most = len(density.free), float("inf")
    if density.noise_scale > UNEXPLAINED:
        most = max(MOST_SOLUTIONS // len(density.readings.row_slip), FEWEST_SAMPLES)
    found = importance_sample(
        log_density,
        p,
        least_effective_size=ENOUGH,
        middle_std=0.5 / region.half_width,
        most_samples=most,
    )
    kept = found.weights > 0.0
    u, weights = region.points(found.u[kept]), found.weights[kept]
    return ImportanceSample(u, weights, found.evidence + region.log_volume)
