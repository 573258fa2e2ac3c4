"""The Bayes limit of the benchmark's sets: exact posteriors, slow, so made once and kept."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from datagen.recipe import Recipe
from soilml.config.case import Case
from soilml.identification.free_parameters import select_free
from soilml.identification.observations import read_observations
from soilml.identification.posterior import most_misfit
from soilml.identification.predictions import readings
from soilml.io.table import Table
from soilml.numerics.importance_sampling import ImportanceSample, importance_sample
from training.benchmark.chebyshev_surrogate import interpolated
from training.benchmark.designs import DesignSets, fingerprint, sets_of, shown, with_effect

Floats = NDArray[np.float64]
Progress = Callable[[str, int, int], None]

#: Fractions of the posterior that are kept.
FRACTIONS = (0.05, 0.25, 0.75, 0.95)
#: Samples of the posterior whose density is compared with the truth's.
COMPARED = 200
PROCESSES = 2
TORQUE = "torque_Nm"
#: Effects that no method of the benchmark knows, the designs that are driven with them, and sets.
UNKNOWN = ("slip-sinkage", "torque-offset")
UNKNOWN_DESIGNS = ("1x", "6x3load_N", "18x6slip-3load_N")
UNKNOWN_SETS = 50


@dataclass(frozen=True)
class ExactPosterior:
    r"""The posterior of one set: moments and quantiles (4, q), and how it stands to the truth.

    `density` is the logarithm of the posterior density at the truth, of the parameters as fractions
    of their priors, exact but for sampling of the evidence:

    .. math:: \log p(\theta^* | y) = \log p(y | \theta^*) - \log \int p(y | \theta) d\theta

    `denser` is the share of the posterior that is denser than the truth: a truth is inside the
    smallest region that holds 90 % where it is below 0.9. `flagged`: the residuals of the best
    sample are larger than noise makes them once in a thousand times.
    """

    mean: Floats
    covariance: Floats
    quantiles: Floats
    density: float
    denser: float
    flagged: bool


def exact_posterior(
    case: Case, table: Table, truth: Floats, names: Sequence[str], widen: bool = False
) -> ExactPosterior:
    """The posterior of one set's torques, by the posterior method's own sampler.

    The model is taken by its `Polynomial`, off by less than a hundredth of the noise. With `widen`,
    a flagged set is answered as the posterior method answers it: with noise larger by as much. The
    limit itself is not: noise that is rare is noise still.
    """
    data, free = read_observations(case, shown(table, ["torque"])), select_free(case, names)
    model, reading, noise = interpolated(case, data, free), readings(data)[0], case.noise[TORQUE]

    def squares(u: Floats, larger: float) -> tuple[Floats, Floats]:
        y = model.at(u)
        std = larger * noise.std(y)
        return (((reading - y) / std) ** 2).sum(axis=1), np.log(std).sum(axis=1)

    def logs(u: Floats, larger: float = 1.0) -> Floats:
        """The likelihood but for (2 pi)^(-rows / 2), which is left out of the evidence too."""
        square, size = squares(u, larger)
        return np.asarray(-0.5 * square - size)

    found = importance_sample(logs, len(free))
    best = found.u[[int(np.argmax(found.weights))]]
    freedom = len(reading) - len(free)
    misfit = float(squares(best, 1.0)[0][0]) / max(freedom, 1)
    flagged = misfit > most_misfit(freedom)
    if widen and flagged:
        found = importance_sample(partial(logs, larger=float(np.sqrt(misfit))), len(free))
    values = np.stack([f.prior.at(found.u[:, i]) for i, f in enumerate(free)], axis=1)
    mean = found.mean(values)
    off = values - mean
    at_truth = [f.prior.fraction(float(t)) for f, t in zip(free, truth, strict=True)]
    density = logs(np.vstack([at_truth, _drawn(found)]))
    return ExactPosterior(
        mean=mean,
        covariance=(off.T * found.weights) @ off,
        quantiles=found.quantiles(values, np.asarray(FRACTIONS)),
        density=float(density[0]) - found.evidence,
        denser=float(np.mean(density[1:] > density[0])),
        flagged=bool(flagged),
    )


def _drawn(found: ImportanceSample) -> Floats:
    """Some samples of the posterior, evenly through its weights."""
    places = (np.arange(COMPARED) + 0.5) / COMPARED
    rows = np.searchsorted(np.cumsum(found.weights), places)
    return found.u[np.minimum(rows, len(found.u) - 1)]


@dataclass(frozen=True)
class Job:
    """One set whose limit is wanted; `effect` is blank where the model knows all there is."""

    effect: str
    design: str
    number: int
    case: Case
    table: Table
    truth: Floats
    names: tuple[str, ...]

    @property
    def hash(self) -> str:
        """What the stored limit is recognised by."""
        return fingerprint(self.table, self.case)


def jobs(recipe: Recipe, names: Sequence[str], most: int | None = None) -> list[Job]:
    """Every set of the benchmark, those with an unknown effect last."""
    found = [("", sets) for sets in sets_of(recipe, names, most)]
    found += [(e, s) for e in UNKNOWN for s in unknown_sets(recipe, e, names, most)]
    return [
        Job(effect, sets.design.key, i, recipe.case, table, sets.truth[i], tuple(names))
        for effect, sets in found
        for i, table in enumerate(sets.tables)
    ]


def unknown_sets(
    recipe: Recipe, effect: str, names: Sequence[str], most: int | None = None
) -> list[DesignSets]:
    """The sets that are driven with an effect which no method knows."""
    count = UNKNOWN_SETS if most is None else min(most, UNKNOWN_SETS)
    made = sets_of(with_effect(recipe, effect), names, count)
    return [sets for sets in made if sets.design.key in UNKNOWN_DESIGNS]


def computed(wanted: Sequence[Job], progress: Progress) -> Iterator[ExactPosterior]:
    """The limit of each job, in order, from two processes."""
    with ProcessPoolExecutor(min(PROCESSES, os.cpu_count() or 1)) as pool:
        for done, found in enumerate(pool.map(_answered, wanted, chunksize=4), 1):
            progress("the Bayes limit", done, len(wanted))
            yield found


def _answered(job: Job) -> ExactPosterior:
    return exact_posterior(job.case, job.table, job.truth, job.names, widen=bool(job.effect))
