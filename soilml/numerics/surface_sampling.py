"""Samples of a density from few evaluations of its model, by polynomials fitted to it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from soilml.arrays import Floats
from soilml.numerics.importance_sampling import LEAST_EFFECTIVE_SIZE, ImportanceSample
from soilml.numerics.resampling import effective_size, latin_hypercube, systematic_resampling
from soilml.numerics.surrogate_density import (
    REACH,
    ModelDensity,
    PolynomialSurface,
    SamplingBox,
    Scaling,
    SurrogateDensity,
    fit_surface,
    term_count,
)

#: Points for each variable at which the model is evaluated in a round: over the whole cube, and
#: where the region is known, so that lower degrees do.
POINTS_IN_CUBE, POINTS_IN_REGION = 64, 40
MOST_ROUNDS = 10  # Most rounds
#: Total degrees that are tried, and points that each coefficient needs.
DEGREES, POINTS_PER_TERM = (2, 3, 4, 5, 6), 1.6
#: Largest standard deviation of the error of the log density: weights that would correct it have an
#: effective size of 99 % of the number of samples. While the density is approached, a power of it
#: is sampled whose error is below the second value.
LARGEST_ERROR, LARGEST_INTERIM_ERROR = 0.1, 0.7
#: Least power of the density that is sampled, and least factor between two powers.
LEAST_POWER, LEAST_FACTOR = 1e-6, 1e-3
INTERIM_SIZE = 300.0  # Effective size of samples from which the next points are drawn
#: New points are samples of the density, this much farther from its middle, and moved at random by
#: this share of its standard deviations.
SPREAD, JITTER = 1.5, 0.3
#: Samples of a normal density that shows the region, and their spread over that of the density.
NORMAL_SAMPLES, WIDER = 2048, 1.2
FEWEST_POINTS = 8.0  # Effective number of points that the final error is judged by, at least
#: Largest probability of the outermost twentieth of a region: more shows that the density goes on
#: beyond. The next regions then reach farther by the second value: the tail of an exponential
#: distribution ends at seven standard deviations, that of a normal one at four.
MOST_AT_FACES, FARTHER = 1e-3, 1.25
#: Share of new points without a prediction above which the region has an edge that no polynomial
#: describes.
MOST_UNPREDICTED = 0.01


def surface_sample(
    density: ModelDensity,
    p: int,
    start: ImportanceSample | None = None,
    tempered_rounds: int = MOST_ROUNDS,
    most_rounds: int = MOST_ROUNDS,
) -> ImportanceSample | None:
    """Weighted samples of a density over the unit cube, from few evaluations of its model.

    The model's predictions are replaced by polynomials in the region that the density occupies.
    Each round evaluates the model at new points of that region, tests the polynomials of the round
    before there, and fits them again; the first region is the cube, or that of `start`. While the
    polynomials are not accurate enough for the density, they are for a power of it, which gives
    the next region. Sampling ends where they are accurate at new points of the density's region.

    density: The model and the density.
    p: Number of variables.
    start: Samples of a density that is similar and wider.
    tempered_rounds: Rounds after which polynomials must be accurate enough for the density, not a
        power of it.
    most_rounds: Rounds after which it ends in any case.

    Returns: None where no polynomial is accurate enough, or not soon enough, or where predictions
    are missing in the region.
    References: Marzouk and Xiu, Communications in Computational Physics 6(4), 2009 (polynomials in
    place of a model in its posterior). Conrad, Marzouk, Pillai and Smith, J. American Statistical
    Association 111(516), 2016 (their refinement where the posterior is).
    """
    rng = np.random.default_rng(0)
    points, predictions = [], []
    samples, surrogate, reach = start, None, REACH
    for turn in range(1, most_rounds + 1):
        later = most_rounds - turn  # rounds that may follow
        if samples is None:
            u = latin_hypercube(POINTS_IN_CUBE * p, p, rng)
        else:
            u = _spread(samples, POINTS_IN_REGION * p, rng)
        y = density.predict(u)
        known = np.isfinite(y).all(axis=1)
        if not known.any():
            return None
        points.append(u[known])
        predictions.append(y[known])
        region = SamplingBox.cube(p) if samples is None else SamplingBox.of(samples, reach)
        surface, errors = _fitted(np.concatenate(points), np.concatenate(predictions), region)
        if surrogate is not None and surrogate.power == 1.0:
            if known.mean() < 1.0 - MOST_UNPREDICTED:
                return None
            if _error_at(surrogate, region, u[known], y[known]) <= LARGEST_ERROR:
                final = SurrogateDensity(density, region, surface).sample(LEAST_EFFECTIVE_SIZE)
                if region.share_at_faces(final) <= MOST_AT_FACES:
                    return final
                reach *= FARTHER
        if later == 0:
            return None
        # the last round can only test the polynomials: before it they must serve for the density
        least_power = 1.0 if later == 1 else LEAST_POWER
        approach = SurrogateDensity(density, region, surface)
        found = _approached(approach, errors, least_power, rng)
        if found is None:
            return None
        surrogate, samples = found
        if turn >= tempered_rounds and surrogate.power < 1.0:
            return None
    return None


def normal_sample(middle: Floats, root: Floats) -> ImportanceSample:
    """Samples of a normal density, wider than the root (p, p) of its covariance; reflected.

    They lie within the unit cube, with equal weights.
    """
    normal = np.random.default_rng(0).standard_normal((NORMAL_SAMPLES, len(middle)))
    u = middle + WIDER * normal @ root.T
    u = np.clip(1.0 - np.abs(1.0 - np.abs(u)), 1e-6, 1.0 - 1e-6)  # reflected at the faces
    return ImportanceSample(u, np.full(NORMAL_SAMPLES, 1.0 / NORMAL_SAMPLES), 0.0)


def _fitted(u: Floats, y: Floats, region: SamplingBox) -> tuple[PolynomialSurface, Floats]:
    """The surface of the degree with the least leave-one-out errors, and these errors (n, k)."""
    p, distance = u.shape[1], region.distance(u)
    reach = max(REACH, region.half_width)
    enough = int(np.ceil(POINTS_PER_TERM * term_count(p, DEGREES[0])))
    near = np.argsort(distance)[: max(int(np.count_nonzero(distance <= reach)), enough)]
    u, y = u[near], y[near]
    degrees = [d for d in DEGREES if POINTS_PER_TERM * term_count(p, d) <= len(near)]
    fits = [fit_surface(region.scaling, degree, u, y) for degree in degrees or DEGREES[:1]]
    deviation = y.std(axis=0)
    scale = np.where(deviation > 0.0, deviation, 1.0)
    return min(fits, key=lambda fit: float(np.mean((fit[1] / scale) ** 2)))


def _approached(
    surrogate: SurrogateDensity, errors: Floats, least_power: float, rng: np.random.Generator
) -> tuple[SurrogateDensity, ImportanceSample] | None:
    """The largest power of the density that the surface is accurate enough for, and samples.

    None where it is below the least power.
    """
    power = 1.0
    while power >= least_power:
        surrogate = replace(surrogate, power=power)
        samples = surrogate.sample(INTERIM_SIZE)
        if not np.isfinite(samples.evidence):
            return None
        error = surrogate.error_under(samples, errors, rng)
        if error <= LARGEST_INTERIM_ERROR:
            return surrogate, samples
        power *= max(0.7 * LARGEST_INTERIM_ERROR / error, LEAST_FACTOR)
    return None


def _error_at(surrogate: SurrogateDensity, region: SamplingBox, u: Floats, y: Floats) -> float:
    """Standard deviation, under the density, of the error of its logarithm at new points (n, p).

    `y` (n, k) are the predictions there, and `region` that of the samples that the points are
    spread about. Infinite where few points share the weight.
    """
    logs = surrogate.density.of_predictions(y)
    error = logs - surrogate(u)
    # the points are spread wider than the density: a normal one of this width
    log_weights = logs + 0.5 * region.distance(u) ** 2 / (SPREAD**2 + JITTER**2)
    if not (np.isfinite(log_weights) & np.isfinite(error)).all():
        return np.inf
    weights = np.exp(log_weights - log_weights.max())
    weights /= weights.sum()
    if effective_size(weights) < FEWEST_POINTS:
        return np.inf
    return float(np.sqrt(weights @ (error - weights @ error) ** 2))


def _spread(samples: ImportanceSample, count: int, rng: np.random.Generator) -> Floats:
    """Points (count, p) of the cube, spread wider than samples."""
    scaling = Scaling.of(samples.u, samples.weights)
    chosen = samples.u[systematic_resampling(samples.weights, count, rng.random())]
    z = SPREAD * scaling(chosen) + JITTER * rng.standard_normal(chosen.shape)
    u = 1.0 - np.abs(1.0 - np.abs(scaling.back(z)))  # reflected at the faces of the cube
    return np.clip(u, 1e-9, 1.0 - 1e-9)
