"""The Bayes limit of the benchmark's sets: exact posteriors, computed once and stored."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.polynomial.chebyshev import chebvander

from datagen.recipe import Recipe
from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.errors import FitError
from soilml.fitting.coordinates import Coordinate, select_free
from soilml.fitting.misfit import misfit_limit
from soilml.fitting.predictions import predict_channels
from soilml.fitting.readings import Readings
from soilml.fitting.usable_readings import usable_readings
from soilml.io.table import Table
from soilml.numerics.importance_sampling import importance_sample
from soilml.numerics.resampling import systematic_resampling
from soilml.processes import process_map
from training.benchmark.bayes_limit_file import FRACTIONS, HPD_DRAWS, PosteriorSummary
from training.benchmark.designs import (
    DesignSets,
    generate_design_sets,
    recipe_with_effect,
    select_channels,
    set_hash,
)

Progress = Callable[[str, int, int], None]

#: Interpolation nodes along each parameter: 1000 evaluations of the model for three parameters,
#: against the ten thousand and more that posterior sampling needs.
NODES = 10
#: Random points that the surrogate is verified at, and the largest relative error accepted there,
#: a hundredth of 2 % noise.
CHECK_POINTS = 64
TOLERANCE = 2e-4


@dataclass(frozen=True)
class ChebyshevSurrogate:
    """Torques of r rows: coefficients (NODES^p, r) of tensor products of Chebyshev polynomials."""

    coefficients: Floats

    def torque(self, u: Floats) -> Floats:
        """Torques (n, r), N m, at fractions of the priors (n, p)."""
        basis = np.ones((len(u), 1))
        for fraction in u.T:
            polynomials = chebvander(2.0 * fraction - 1.0, NODES - 1)
            basis = (basis[:, :, None] * polynomials[:, None, :]).reshape(len(u), -1)
        return np.asarray(basis @ self.coefficients)


def fit_chebyshev_surrogate(
    case: Case, readings: Readings, free: Sequence[Coordinate]
) -> ChebyshevSurrogate:
    """Interpolate the model's torques at the Chebyshev nodes of the prior box.

    Raises `FitError` where the relative error exceeds `TOLERANCE` at a check point: the torque is
    then not smooth over the prior.

    References: Trefethen, Approximation Theory and Approximation Practice, SIAM, 2013.
    """
    p = len(free)
    node = np.cos(np.pi * (np.arange(NODES) + 0.5) / NODES)
    fraction = 0.5 * (1.0 + node)
    grid = np.stack(np.meshgrid(*[fraction] * p, indexing="ij"), axis=-1).reshape(-1, p)
    values = predict_channels(case, free, grid, readings.at)["torque"]
    inverse = np.linalg.inv(chebvander(node, NODES - 1))
    cube = values.reshape(*[NODES] * p, -1)
    for axis in range(p):
        cube = np.moveaxis(np.tensordot(inverse, cube, axes=(1, axis)), 0, axis)
    surrogate = ChebyshevSurrogate(cube.reshape(NODES**p, -1))
    u = np.random.default_rng(0).random((CHECK_POINTS, p))
    true = predict_channels(case, free, u, readings.at)["torque"]
    error = float(np.max(np.abs(surrogate.torque(u) / true - 1.0)))
    if not error < TOLERANCE:
        raise FitError(
            f"the torque is not a smooth function of the soil here: relative error {error:.1e}, "
            f"needed is less than {TOLERANCE:.1e}"
        )
    return surrogate


TORQUE = "torque_Nm"
#: Effects that no method of the benchmark models, the designs that are simulated with them, and
#: the number of sets of each.
UNMODELLED_EFFECTS = ("slip-sinkage", "torque-offset")
UNMODELLED_DESIGNS = ("1x", "6x3load_N", "18x6slip-3load_N")
UNMODELLED_SETS = 50


def exact_posterior(
    case: Case, table: Table, truth: Floats, names: Sequence[str], inflate_noise: bool = False
) -> PosteriorSummary:
    """The posterior of one set's torques, by the sampler of the `posterior` method.

    case: Model, priors and noise of the simulation.
    table: Slips, loads (N) and torques (N m) of one soil.
    truth: True values (q,) of the parameters.
    names: The parameters.
    inflate_noise: Treat a flagged set as the `posterior` method does: with a noise standard
        deviation that is larger by the root of the reduced chi-square. False for the Bayes limit
        itself, because the noise level is known there: large residuals are rare noise.

    Notes
    -----
    The model's torque is replaced by `ChebyshevSurrogate`, whose error is below a hundredth of the
    noise.
    """
    readings, free = (
        usable_readings(case, select_channels(table, ["torque"])),
        select_free(case, names),
    )
    surrogate = fit_chebyshev_surrogate(case, readings, free)
    reading, noise = (readings.measured, readings.std)[0], case.noise[TORQUE]

    def misfit_terms(u: Floats, noise_factor: float) -> tuple[Floats, Floats]:
        """Chi-square (n,), and the sum (n,) over rows of the logarithm of the noise."""
        y = surrogate.torque(u)
        std = noise_factor * noise.std(y)
        return (((reading - y) / std) ** 2).sum(axis=1), np.log(std).sum(axis=1)

    def log_likelihood(u: Floats, noise_factor: float = 1.0) -> Floats:
        """Without the factor (2 pi)^(-rows / 2), which is left out of the evidence too."""
        chi_square, log_noise = misfit_terms(u, noise_factor)
        return np.asarray(-0.5 * chi_square - log_noise)

    sample = importance_sample(log_likelihood, len(free))
    best = sample.u[[int(np.argmax(sample.weights))]]
    freedom = len(reading) - len(free)
    reduced_chi_square = float(misfit_terms(best, 1.0)[0][0]) / max(freedom, 1)
    flagged = reduced_chi_square > misfit_limit(freedom)
    if inflate_noise and flagged:
        factor = float(np.sqrt(reduced_chi_square))
        sample = importance_sample(partial(log_likelihood, noise_factor=factor), len(free))
    values = np.stack([f.prior.at(sample.u[:, i]) for i, f in enumerate(free)], axis=1)
    mean = sample.mean(values)
    deviation = values - mean
    at_truth = [f.prior.fraction(float(t)) for f, t in zip(free, truth, strict=True)]
    draws = sample.u[systematic_resampling(sample.weights, HPD_DRAWS, 0.5)]
    density = log_likelihood(np.vstack([at_truth, draws]))
    return PosteriorSummary(
        mean=mean,
        covariance=(deviation.T * sample.weights) @ deviation,
        quantiles=sample.quantiles(values, np.asarray(FRACTIONS)),
        log_density=float(density[0]) - sample.evidence,
        hpd_level=float(np.mean(density[1:] > density[0])),
        flagged=bool(flagged),
    )


@dataclass(frozen=True)
class BenchmarkSet:
    """One set of the benchmark; `effect` is blank where the model is complete."""

    effect: str
    design: str
    number: int
    case: Case
    table: Table
    truth: Floats
    names: tuple[str, ...]

    @property
    def hash(self) -> str:
        """Identifies the rows that a stored posterior belongs to."""
        return set_hash(self.table, self.case)


def benchmark_sets(
    recipe: Recipe, names: Sequence[str], max_sets: int | None = None
) -> list[BenchmarkSet]:
    """Every set of the benchmark, those with an unmodelled effect last."""
    designs = [("", sets) for sets in generate_design_sets(recipe, names, max_sets)]
    for effect in UNMODELLED_EFFECTS:
        designs += [(effect, s) for s in unmodelled_sets(recipe, effect, names, max_sets)]
    return [
        BenchmarkSet(
            effect=effect,
            design=s.design.key,
            number=i,
            case=recipe.case,
            table=table,
            truth=s.truth[i],
            names=tuple(names),
        )
        for effect, s in designs
        for i, table in enumerate(s.tables)
    ]


def unmodelled_sets(
    recipe: Recipe, effect: str, names: Sequence[str], max_sets: int | None = None
) -> list[DesignSets]:
    """The sets that are simulated with an effect that no method models."""
    count = UNMODELLED_SETS if max_sets is None else min(max_sets, UNMODELLED_SETS)
    designs = generate_design_sets(recipe_with_effect(recipe, effect), names, count)
    return [sets for sets in designs if sets.design.key in UNMODELLED_DESIGNS]


def compute_posteriors(
    sets: Sequence[BenchmarkSet], progress: Progress
) -> Iterator[PosteriorSummary]:
    """The exact posterior of each set, in order, computed on all cores."""
    with process_map(_posterior_of, sets) as found:
        for done, summary in enumerate(found, 1):
            progress("the Bayes limit", done, len(sets))
            yield summary


def _posterior_of(one: BenchmarkSet) -> PosteriorSummary:
    return exact_posterior(
        one.case, one.table, one.truth, one.names, inflate_noise=bool(one.effect)
    )
