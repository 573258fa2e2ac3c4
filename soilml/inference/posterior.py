"""Every answer as a marginal of one posterior over hypotheses, hyperparameters and unknowns."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.fitting.coordinates import values_at
from soilml.fitting.covariance import Whitening
from soilml.fitting.least_squares import Solution
from soilml.inference import constants
from soilml.inference.draws import DRAWS, Component, Draws, marginal, proposals, weighted
from soilml.inference.explanation import Explanation
from soilml.inference.gaussian_terms import GaussianTerms, Hyperparameters
from soilml.inference.priors import unknown_cause
from soilml.inference.problem import SOIL_ALONE, InferenceProblem
from soilml.inference.search import Search
from soilml.results import EstimatedValue

Names = tuple[str, ...]

#: Largest absolute log odds that are stated; beyond it a probability is 0 or 1 in any sense.
MOST_LOG_ODDS = 500.0
#: Largest change of other channels, in sigma and relative to that of one, that counts as none.
UNCHANGED = 0.01


def infer(
    problem: InferenceProblem, progress: Callable[[float], None] = lambda _: None
) -> Posterior:
    """The posterior of a problem; of one that was asked before, the same again.

    Raises `InputError` where the model cannot be fitted. Where it cannot carry the loads of some
    rows, `Posterior.refused` is the fit that shows which.
    """
    key = problem.checksum()
    if key in _known:
        return _known[key]
    found = _known[key] = Posterior(Search(problem, progress).run())
    while len(_known) > KEPT:
        _known.pop(next(iter(_known)))
    return found


#: Posteriors of a process that are kept, by the checksum of their problem: `identify`, `gap` and
#: `pull` of the same rows compute one.
KEPT = 3
_known: dict[str, Posterior] = {}


@dataclass(frozen=True, eq=False)
class Posterior:
    """Probabilities of hypotheses, and what follows from them.

    Single effects that were never fitted, since their prediction is far from the best, count with
    their predicted evidence.
    """

    search: Search
    _drawn: dict[tuple[int, int], list[Draws]] = field(default_factory=dict)

    @property
    def problem(self) -> InferenceProblem:
        """The problem, with the noise that its readings have at the fit."""
        return self.search.problem

    @property
    def terms(self) -> GaussianTerms:
        """All that is no effect."""
        return self.search.terms

    @property
    def refused(self) -> Solution | None:
        """The best fit where none carries the loads of all rows."""
        return self.search.refused

    @cached_property
    def nodes(self) -> tuple[Explanation, ...]:
        """Fitted hypotheses, the likeliest first."""
        return tuple(sorted(self.search.nodes.values(), key=lambda node: node.value))

    @property
    def best(self) -> Explanation:
        """The likeliest hypothesis."""
        return self.nodes[0]

    @property
    def soil(self) -> Explanation:
        """The soil alone, within the priors of the case."""
        return self.search.nodes[SOIL_ALONE]

    @cached_property
    def noise(self) -> Hyperparameters:
        """Noise and scatter by the likeliest hypothesis, without a discrepancy."""
        return self.terms.without_discrepancy(self.best.at)

    @cached_property
    def std(self) -> Floats:
        """Standard deviation (m,) of the readings by noise and scatter."""
        return self.terms.std(self.noise)

    @property
    def outliers(self) -> NDArray[np.bool_]:
        """Readings (m,) that stray by the likeliest hypothesis."""
        return self.best.outliers

    @cached_property
    def whiten(self) -> Whitening:
        """What whitens noise and scatter; outliers weigh nothing."""
        return self.terms.whiten(self.noise, self.outliers)

    def discrepancy(self, node: Explanation, at: Hyperparameters | None = None) -> Floats:
        """Mean (m,) of the smooth discrepancy beside a node, in the unit of the readings."""
        terms, at = self.terms, at or node.at
        found = node.linear.evaluate(at)
        own = found.used[np.isin(terms.group[found.used], np.arange(terms.channels))]
        weights = found.weights[np.isin(found.used, own)] * np.sqrt(terms.variance(at)[own])
        return np.asarray(terms.columns[:, own] @ weights)

    @cached_property
    def _weights(self) -> tuple[list[Names], Floats]:
        """Effects and probability of every hypothesis."""
        tried = self.search.nodes
        items = [(n.hypothesis, n.value) for n in self.nodes]
        items += [
            (h, own.value)
            for h, own in self.search.predicted.items()
            if h not in tried and len(h.effects) == 1 and h not in self.search._tried
        ]
        values = np.asarray([value for _, value in items])
        weights = np.exp(-0.5 * (values - values.min()))
        weights /= weights.sum()
        return [h.effects for h, _ in items], weights

    @cached_property
    def only_channel(self) -> dict[str, str]:
        """The channel of each effect that changes one of the measured channels alone, by name."""
        readings, found = self.terms.readings, {}
        for s in self.search.signatures.get((), []):
            change = np.abs(s.column / readings.std)
            largest = readings.channel[int(np.argmax(change))]
            others = change[readings.channel != largest]
            if others.max(initial=0.0) < UNCHANGED * change.max():
                found[s.name] = readings.channels[largest]
        return found

    def node_weight(self, node: Explanation) -> float:
        """Probability of a fitted hypothesis."""
        return float(self._weights[1][self.nodes.index(node)])

    @cached_property
    def sets(self) -> dict[Names, float]:
        """Probability of exactly these effects within the catalogue, the likeliest first."""
        found: dict[Names, float] = {}
        for names, weight in zip(*self._weights, strict=True):
            found[names] = found.get(names, 0.0) + float(weight)
        return dict(sorted(found.items(), key=lambda item: (-item[1], item[0])))

    @cached_property
    def no_effect(self) -> float:
        """Probability that no effect is present, whatever else is."""
        return self.sets.get((), 0.0)

    @cached_property
    def no_gap(self) -> float:
        """Probability that the soil alone, within its priors, explains the rows.

        Beside no discrepancy, or beside one that is far below the noise in every channel.
        """
        own, terms = self.soil, self.terms
        share = own.share_without
        size = np.abs(self.discrepancy(own, own.beside.at)) / terms.std(own.beside.at)
        channel = terms.readings.channel
        squares = [np.mean(size[channel == i] ** 2) for i in range(terms.channels)]
        if np.sqrt(max(squares, default=0.0)) < constants.NEGLIGIBLE_DISCREPANCY:
            share = 1.0
        return self.node_weight(own) * share

    @property
    def scatters(self) -> bool:
        """Whether usual scatter of the soil from run to run accounts for residuals above the noise.

        There is no gap, and the noise of no channel is far above the declared one.
        """
        terms, at = self.terms, self.soil.without.at
        noise, scatter = terms.noise_scale(at).max(), terms.scatter(at).max()
        usual = noise < constants.NOISE_SCALED_UP and scatter < constants.UNUSUAL_RUN_EFFECT
        return bool(usual and scatter > 0.0 and self.no_gap > constants.LIKELIER)

    @cached_property
    def outside(self) -> float:
        """Probability of a gap with a cause that no effect of the catalogue describes.

        That is a discrepancy beside the soil alone; and beside effects, an amplitude that is
        likelier of an unknown cause than of a usual error, or a signature that an effect imitates.
        """
        found = 0.0
        for node, weight in zip(self.nodes, self._weights[1], strict=False):
            present = 1.0 - node.share_without
            if not node.hypothesis.effects:
                found += weight * present
                continue
            amplitude = np.exp(node.beside.at.log[: self.terms.channels])
            usual = 1.0 - present * unknown_cause(amplitude)
            found += weight * (1.0 - constants.IN_CATALOGUE * usual)
        return float(found)

    def within(self, effects: Collection[str]) -> float:
        """Probability that these effects are present, within the catalogue."""
        return sum(p for names, p in self.sets.items() if set(effects) <= set(names))

    def probability(self, *effects: str) -> float:
        """Probability that these effects are present, causes outside the catalogue included."""
        return constants.IN_CATALOGUE * self.within(effects)

    def log_odds(self, *effects: str) -> float:
        """Natural logarithm of the odds that these effects are present, within the catalogue."""
        p = self.within(effects)
        odds = np.log(max(p, 1e-300)) - np.log(max(1.0 - p, 1e-300))
        return float(np.clip(odds, -MOST_LOG_ODDS, MOST_LOG_ODDS))

    def effects(self) -> list[str]:
        """All effects with a probability, the likeliest first."""
        names = {name for own in self.sets for name in own}
        return sorted(names, key=lambda name: (-self.within([name]), name))

    def node_of(self, effects: Names) -> Explanation | None:
        """The likeliest fitted hypothesis of exactly these effects."""
        return next((n for n in self.nodes if n.hypothesis.effects == effects), None)

    def components(self) -> list[Component]:
        """Hypotheses, each with and without a discrepancy, and their probabilities; sum one."""
        found = []
        for node, weight in zip(self.nodes, self._weights[1], strict=False):
            share = node.share_without
            for evidence, part in ((node.without, share), (node.beside, 1.0 - share)):
                if weight * part > constants.LEAST_DRAWN:
                    found.append(Component(node, evidence.at, float(weight * part)))
        total = sum(c.weight for c in found)
        return [replace(c, weight=c.weight / total) for c in found]

    def draws(self, seed: int, count: int = DRAWS) -> list[Draws]:
        """Draws of hypothesis, discrepancy, hyperparameters and coordinates.

        Coordinates are proposed from Laplace's approximation, widened, and weighted by the density
        of the full model, so that bounds and curvature count; the probability of each component
        stays that of its evidence.

        References: Geweke, Econometrica 57, 1989 (importance sampling from widened proposals).
        """
        if (seed, count) in self._drawn:
            return self._drawn[seed, count]
        rng = np.random.default_rng(seed)
        proposed = [
            own for one in self.components() for own in proposals(one, self.terms, count, rng)
        ]
        self._drawn[seed, count] = [weighted(*own, self.terms) for own in proposed]
        return self._drawn[seed, count]

    def beside(self, fixed: Floats, inner: Sequence[Floats] = ()) -> Posterior:
        """The same hypotheses beside further Gaussian terms; see `Search.beside`."""
        return Posterior(self.search.beside(fixed, inner))

    def soil_marginals(self, seed: int, factor: float = 1.0) -> dict[str, EstimatedValue]:
        """Marginals of the soil parameters that are free within the case's priors, by path.

        factor: By which intervals are widened about their mean.
        """
        own = self.draws(seed)
        found = {}
        for c in self.problem.soil:
            values, weights = [], []
            for part in own:
                paths = [other.path for other in part.node.fit.coordinates]
                at = paths.index(c.path)
                values.append(values_at([part.node.fit.coordinates[at]], part.x[:, [at]])[:, 0])
                weights.append(part.weight)
            found[c.path] = marginal(
                np.concatenate(values), np.concatenate(weights), c.unit, factor
            )
        return found
