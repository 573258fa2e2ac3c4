"""One search: fit, estimate hyperparameters, predict every addition, fit what is within reach.

A node is a hypothesis that was fitted. From each node near the best one, the evidence of every
addition (an effect, free laws, opened priors) is predicted by a linear model, under a ladder of
hyperparameters that it may lead to: as fitted, without discrepancy, with less of it, with hardly
any scatter. The best are fitted, in turn with their hyperparameters, until nothing is left to fit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.errors import InputError
from soilml.fitting.coordinates import Coordinate
from soilml.fitting.covariance import noise_of_operation
from soilml.fitting.damped_descents import COARSE, FINE, Asking, Tolerance, descent, in_step
from soilml.fitting.effect_signatures import Signature, current_size, effect_signatures
from soilml.fitting.least_squares import LeastSquaresProblem, Solution
from soilml.fitting.predictions import Linearisation
from soilml.inference import constants
from soilml.inference.evidence import Evidence, LinearisedFit, linear_model, of_priors
from soilml.inference.gaussian_terms import (
    DISCREPANCY,
    SCATTER,
    GaussianTerms,
    Hyperparameters,
    gaussian_terms,
    scatter_columns,
)
from soilml.inference.problem import SOIL_ALONE, Hypothesis, InferenceProblem
from soilml.remarks import Remark

Booleans = NDArray[np.bool_]

#: Starts of the fit of the soil, as fractions of each prior, besides the case's own values.
SOIL_STARTS = (0.5, 0.25)
#: Objective within which of the best first fit of the soil others are optima to keep.
OTHER_OPTIMUM = 50.0
#: Nodes from which additions are predicted, the likeliest first.
EXTENDED = 6
#: Evidence within which fits without a discrepancy, which may hide their effects, are kept.
NEAR_HIDDEN = 40.0
#: Share of the distance from the middle of its prior at which a soil parameter starts again, and
#: distance from the ends of an opened one: a start at a bound would stay there.
INWARD, OFF_BOUNDS = 0.8, 0.02
#: Steps of the ladder: of the logarithm of the discrepancy, and the logarithm of hardly any
#: scatter; scatter above the third counts as some.
LESS_DISCREPANCY, LITTLE_SCATTER, SOME_SCATTER = 1.0, -1.5, -0.7
#: Amplitude of a discrepancy, in usual ones, from which the priors of the soil are opened.
LARGE_DISCREPANCY = 3.0
#: Amplitudes and scatter below the first (the logarithm below the second) count less where they
#: change.
SMALL, USUAL, OF_SMALL = 0.3, -0.5, 0.2
#: Readings that are taken as outliers in one estimate, at most.
MOST_OUTLIERS = 12


@dataclass(eq=False)
class Explanation:
    """A hypothesis that was fitted.

    value: -2 ln of its posterior probability, up to a constant that all share.
    beside, without: Evidence with a discrepancy, and without one.
    outliers (m,): Readings that stray by this hypothesis.
    """

    hypothesis: Hypothesis
    fit: Solution
    linear: LinearisedFit
    beside: Evidence
    without: Evidence
    value: float
    outliers: Booleans
    extended: bool = False

    @property
    def best(self) -> Evidence:
        """The evidence of the likelier of both."""
        return min(self.beside, self.without, key=lambda own: own.trusted)

    @property
    def promising(self) -> Evidence:
        """That of the likelier one if steps are as good as they promise: where to fit next."""
        return min(self.beside, self.without, key=lambda own: own.value)

    @property
    def share_without(self) -> float:
        """Probability that there is no discrepancy, given the hypothesis."""
        logs = np.log([1.0 - constants.DISCREPANCY_PRIOR, constants.DISCREPANCY_PRIOR])
        logs = logs - 0.5 * np.asarray([self.without.trusted, self.beside.trusted])
        return float(np.exp(logs[0] - np.logaddexp(*logs)))

    @property
    def at(self) -> Hyperparameters:
        """The hyperparameters of the likelier of both."""
        return self.best.at


@dataclass(frozen=True)
class Prediction:
    """The predicted value of a hypothesis, and where its fit starts."""

    value: float
    start: Mapping[str, float]
    at: Hyperparameters
    outliers: Booleans


@dataclass(frozen=True)
class StartedFit:
    """A fit to be made: hypothesis, coordinates to start from by path, and hyperparameters."""

    hypothesis: Hypothesis
    start: Mapping[str, float]
    at: Hyperparameters
    outliers: Booleans
    near: Linearisation | None = None


@dataclass(eq=False)
class Search:
    """The nodes of a problem, and the predicted values of other hypotheses."""

    problem: InferenceProblem
    progress: Callable[[float], None] = lambda _: None
    nodes: dict[Hypothesis, Explanation] = field(default_factory=dict)
    predicted: dict[Hypothesis, Prediction] = field(default_factory=dict)
    untestable: dict[str, Remark] = field(default_factory=dict)
    signatures: dict[tuple[str, ...], list[Signature]] = field(default_factory=dict)
    _tried: set[Hypothesis] = field(default_factory=set)

    def run(self) -> Search:
        """Fit until nothing near the best is left.

        Raises `InputError` where the model cannot carry the loads of the rows.
        """
        self._fit_soil()
        for number in range(0 if self.refused else constants.ROUNDS):
            self.progress((1.0 + number) / (2.0 + constants.ROUNDS))
            jobs = self._proposed(first=number == 0)
            if not jobs:
                break
            self._tried |= {job.hypothesis for job in jobs}
            self._settle(jobs, self.lowest)
        return self

    @property
    def lowest(self) -> float:
        """The value of the best node."""
        return min((node.value for node in self.nodes.values()), default=float("inf"))

    # ---- the soil alone

    def _fit_soil(self) -> None:
        """The soil alone from several starts; noise and scatter as its best fit has them."""
        problem, readings = self.problem, self.problem.readings
        none = np.zeros(len(readings), bool)
        self.terms = gaussian_terms(readings, problem.case, np.zeros((len(readings), 2)))
        starts = [{c.path: c.prior.fraction(c.nominal) for c in problem.soil}]
        starts += [dict.fromkeys((c.path for c in problem.soil), x) for x in SOIL_STARTS]
        jobs = [StartedFit(SOIL_ALONE, start, self.terms.first(), none) for start in starts]
        answers = self.fit(jobs, COARSE)
        fits = [fit for fit in answers if not isinstance(fit, InputError)]
        if not fits:
            raise next(error for error in answers if isinstance(error, InputError))
        carried = [fit for fit in fits if np.isfinite(fit.prediction).all()]
        if not carried:
            self.refused = min(fits, key=lambda fit: fit.objective)
            return
        best = min(carried, key=lambda fit: fit.objective)
        readings = readings.with_noise_at(best.prediction)
        operation = noise_of_operation(best.fitted(), readings)
        if operation.any():
            readings = readings.with_noise_of_operation(operation)
        self.problem = problem = replace(problem, readings=readings)
        self.terms = gaussian_terms(
            readings, problem.case, scatter_columns(best.fitted(), readings)
        )
        kept = [f for f in carried if f.objective < best.objective + OTHER_OPTIMUM]
        first = self.terms.first()
        jobs = [
            StartedFit(SOIL_ALONE, f.start_values(), first, none, f.linearisation) for f in kept
        ]
        self._settle(jobs, float("inf"))
        if not self.nodes:
            raise InputError("the model cannot be fitted to these rows")
        self._choose_autocorrelation(self.nodes[SOIL_ALONE])
        soil = self.nodes[SOIL_ALONE]
        large = self.terms.amplitude(soil.beside.at).max(initial=0.0) > constants.HIDING
        if large and soil.beside.trusted < soil.without.trusted:
            self._fit_hidden(soil, best)

    refused: Solution | None = None

    def _choose_autocorrelation(self, node: Explanation) -> None:
        """The autocorrelation of the largest evidence, where runs are long enough to tell."""
        readings = self.problem.readings
        if np.median(np.bincount(readings.run[readings.row])) < constants.AUTOCORRELATED_RUN:
            return
        for rho in list(constants.AUTOCORRELATIONS)[1:]:
            new = self.node(
                node.hypothesis, node.fit, replace(node.at, autocorrelation=rho), node.outliers
            )
            if new.value < self.nodes[node.hypothesis].value:
                self.nodes[node.hypothesis] = new

    def _fit_hidden(self, soil: Explanation, plain: Solution) -> None:
        """Fit the likeliest single effects without a discrepancy, which can hide them.

        A large discrepancy is a local optimum: beside it, an effect that explains nearly everything
        is not needed. They are predicted from the soil alone under noise and scatter.
        """
        at, linear = soil.without.at, plain.linearisation
        (fit,) = self.fit([StartedFit(SOIL_ALONE, plain.start_values(), at, soil.outliers, linear)])
        if isinstance(fit, InputError):
            return
        model = linear_model(self.terms, fit, soil.outliers)
        at = model.best(at)
        half = np.where(np.arange(len(at.log)) >= self.terms.groups, 0.5 * at.log, at.log)
        alone = replace(soil, fit=fit, linear=model)
        found = self._additions(alone, [at, replace(at, log=half)])
        singles = sorted(
            ((own.value, h, own) for h, own in found.items() if len(h.effects) == 1),
            key=lambda item: item[:2],
        )
        jobs: list[StartedFit] = []
        for _, h, own in singles[: 2 * constants.HIDDEN]:
            start = {path: 0.5 + INWARD * (x - 0.5) for path, x in own.start.items()}
            if not any(job.hypothesis.effects == h.effects for job in jobs) or len(jobs) < 3:
                jobs.append(StartedFit(h, start, own.at, soil.outliers))
            if len(jobs) == constants.HIDDEN:
                break
        self._settle(jobs, float("inf"), NEAR_HIDDEN)

    # ---- fits

    def fit(
        self, jobs: Sequence[StartedFit], tolerance: Tolerance = COARSE
    ) -> list[Solution | InputError]:
        """Fits that share each call of the model; the error of one that the model refuses."""
        works = []
        for job in jobs:
            coordinates = self.problem.coordinates(job.hypothesis)
            whiten = self.terms.whiten(job.at, job.outliers)
            case = self.problem.case_of(job.hypothesis)
            own = LeastSquaresProblem(case, coordinates, self.problem.readings, whiten)
            first = [job.start.get(c.path, self._first_size(c)) for c in coordinates]
            zero = [0.0 if c.effect else job.start.get(c.path, 0.5) for c in coordinates]
            known = job.near
            if known is not None and len(known.x) != len(coordinates):
                known = None
            works.append(_careful(own, np.asarray(first), np.asarray(zero), known, tolerance))
        return in_step(works)

    def _first_size(self, coordinate: Coordinate) -> float:
        """The case's own value of an effect's size, else a size off zero; shapes start at zero."""
        if not coordinate.effect:
            return 0.5
        if coordinate.is_shape:
            return 0.0
        if coordinate.path in self.problem.case.parameters():
            own = coordinate.reference_size
            return current_size(self.problem.case, coordinate.path, own)
        return constants.START_SIZE if coordinate.upper > 0.0 else -constants.START_SIZE

    def node(
        self, hypothesis: Hypothesis, fit: Solution, at: Hyperparameters, outliers: Booleans
    ) -> Explanation:
        """A fit with the hyperparameters of its largest evidence, with and without discrepancy."""
        linear = linear_model(self.terms, fit, outliers)
        beside, without = (
            linear.evidence(linear.best(replace(at, present=present))) for present in (True, False)
        )
        node = Explanation(hypothesis, fit, linear, beside, without, 0.0, outliers)
        prior = constants.DISCREPANCY_PRIOR
        log = np.logaddexp(
            np.log(prior) - 0.5 * beside.trusted, np.log(1.0 - prior) - 0.5 * without.trusted
        )
        node.value = float(-2.0 * log) + self.problem.penalty(hypothesis)
        return node

    def _settle(
        self, jobs: Sequence[StartedFit], lowest: float, margin: float = constants.NEAR
    ) -> None:
        """Fit, estimate hyperparameters, and repeat while these move and the node is near.

        lowest: The value of the best node so far.
        """
        found: dict[Hypothesis, Explanation] = {}
        for turn in range(constants.FITS_IN_TURN):
            again = []
            fits = self.fit(jobs, COARSE if turn == 0 else FINE)
            for job, fit in zip(jobs, fits, strict=True):
                if isinstance(fit, InputError) or not np.isfinite(fit.prediction).all():
                    continue
                try:
                    node = self.node(job.hypothesis, fit, job.at, job.outliers)
                    if node.value < lowest + margin:
                        outliers = self._outliers(node)
                        if (outliers != job.outliers).any():
                            node = self.node(job.hypothesis, fit, node.at, outliers)
                except np.linalg.LinAlgError:
                    continue
                known = found.get(job.hypothesis)
                if known is None or node.value < known.value:
                    found[job.hypothesis] = node
                lowest = min(lowest, node.value)
                target = node.promising.at
                moved = _distance(self.terms, job.at, target) > constants.MOVED
                moved = moved or bool((node.outliers != job.outliers).any())
                if node.value < lowest + margin and (moved or turn == 0):
                    start, near = fit.start_values(), fit.linearisation
                    again.append(StartedFit(job.hypothesis, start, target, node.outliers, near))
            jobs = again
            if not jobs:
                break
        for hypothesis, node in found.items():
            known = self.nodes.get(hypothesis)
            if known is None or node.value < known.value:
                self.nodes[hypothesis] = node

    def _outliers(self, node: Explanation) -> Booleans:
        """Readings (m,) that stray, by their density given all others.

        A reading strays where a normal density with half the range of its channel, and a small
        prior probability, is likelier. One is taken at a time, the farthest first.
        """
        strays, width = node.outliers.copy(), self.terms.largest_outlier
        odds = np.log(constants.OUTLIER_PRIOR / (1.0 - constants.OUTLIER_PRIOR))
        for _ in range(MOST_OUTLIERS):
            error, variance = node.linear.without(strays).leave_one_out(node.at)
            wide = variance + width**2
            usual = -0.5 * (error**2 / variance + np.log(variance))
            far = -0.5 * (error**2 / wide + np.log(wide)) + odds
            gain = np.where(strays, usual - far, far - usual)
            i = int(np.argmax(gain))
            if gain[i] < constants.OUTLIER_GAIN:
                break
            strays[i] = not strays[i]
        return strays

    # ---- proposals

    def _proposed(self, *, first: bool) -> list[StartedFit]:
        """The fits of the next round; in the first one the best single effects in any case."""
        lowest = self.lowest
        near = sorted(self.nodes.values(), key=lambda node: node.value)
        near = [node for node in near if node.value < lowest + constants.NEAR][:EXTENDED]
        for node in {id(n): n for n in (*near, self.nodes[SOIL_ALONE])}.values():
            if node.extended:
                continue
            node.extended = True
            for hypothesis, own in self._additions(node, self._ladder(node)).items():
                known = self.predicted.get(hypothesis)
                if known is None or own.value < known.value:
                    self.predicted[hypothesis] = own
        open_ = [
            (own.value, h)
            for h, own in self.predicted.items()
            if h not in self.nodes and h not in self._tried
        ]
        open_.sort()
        within = [
            (value, h)
            for value, h in open_
            if value < lowest + (constants.NEAR if len(h.effects) <= 1 else constants.NEAR_SET)
        ][: constants.FITS_PER_ROUND]
        if first:
            singles = [own for own in open_ if len(own[1].effects) == 1]
            within = sorted({*within, *singles[: constants.FIRST_SINGLES]})
        chosen = [(h, self.predicted[h]) for _, h in within]
        return [StartedFit(h, own.start, own.at, own.outliers) for h, own in chosen]

    def _ladder(self, node: Explanation) -> list[Hyperparameters]:
        """Hyperparameters that an addition may lead to: less discrepancy, or less scatter."""
        beside, without = node.beside.at, node.without.at
        kinds = self.terms.of_kind(DISCREPANCY), self.terms.of_kind(SCATTER)
        less = np.where(kinds[0], beside.log - LESS_DISCREPANCY, beside.log)
        found = [beside, without, replace(beside, log=less)]
        if max(beside.log[kinds[1]].max(), without.log[kinds[1]].max()) > SOME_SCATTER:
            for at in (beside, without):
                still = np.where(kinds[1], np.minimum(at.log, LITTLE_SCATTER), at.log)
                found.append(replace(at, log=still))
        return found

    def _additions(
        self, node: Explanation, ladder: Sequence[Hyperparameters]
    ) -> dict[Hypothesis, Prediction]:
        """Predicted values of a node's hypothesis with one thing more, the best of a ladder."""
        p = len(node.fit.x)
        extra, moves = self._moves(node)
        model = linear_model(self.terms, node.fit, node.outliers, extra)
        start = node.fit.start_values()
        found: dict[Hypothesis, Prediction] = {}
        prior = constants.DISCREPANCY_PRIOR
        for at in ladder:
            try:
                products, constant = model.reduced(at)
                own = node.linear.evaluate(at)
                rest = node.linear.beside(at, own.curvature) + of_priors(node.linear, own)
            except np.linalg.LinAlgError:
                continue
            rest -= 2.0 * float(np.log(prior if at.present else 1.0 - prior))
            for hypothesis, columns, sign in moves:
                value, step = model.evidence_with(products, constant, [*range(p), *columns], p)
                if sign and step[p] * sign <= 0.0:
                    continue
                value += rest + self.problem.penalty(hypothesis)
                if hypothesis not in found or value < found[hypothesis].value:
                    found[hypothesis] = Prediction(value, start, at, node.outliers)
        return found | self._by_catalogue(node, start) | self._opened(node, start)

    def _moves(
        self, node: Explanation
    ) -> tuple[list[tuple[Coordinate, Floats]], list[tuple[Hypothesis, list[int], int]]]:
        """Further coordinates with their columns, and hypotheses with the numbers of theirs.

        The third entry of a move is the sign that the size of its effect must have, or 0.
        """
        h, fit, problem = node.hypothesis, node.fit, self.problem
        s, w = problem.readings.log_slip_and_load
        terms = {"slip_power": s, "by_slip": problem.readings.slip, "by_load": w}
        extra: list[tuple[Coordinate, Floats]] = []
        moves: list[tuple[Hypothesis, list[int], int]] = []
        p = len(fit.x)
        if len(h.effects) < constants.MOST_EFFECTS:
            for signature in self._signatures(node):
                shapes = problem.shapes(signature.name)
                names, first = tuple(sorted((*h.effects, signature.name))), p + len(extra)
                extra.append((problem.size(signature.name), signature.column))
                extra += [(c, signature.column * terms[c.name]) for c in shapes]
                free = [*range(first, first + 1 + len(shapes))]
                if not h.free_law or not h.effects:
                    moves.append(
                        (replace(h, effects=names, free_law=False), [first], signature.sign)
                    )
                if shapes and (h.free_law or not h.effects):
                    moves.append((replace(h, effects=names, free_law=True), free, signature.sign))
                elif h.free_law:
                    moves.append((replace(h, effects=names), [first], signature.sign))
        if h.effects and not h.free_law:
            first = p + len(extra)
            for i, own in enumerate(fit.coordinates):
                if own.effect:
                    column = fit.derivatives[:, i] * fit.x[i]
                    extra += [(c, column * terms[c.name]) for c in problem.shapes(own.effect)]
            if p + len(extra) > first:
                moves.append((replace(h, free_law=True), [*range(first, p + len(extra))], 0))
        return extra, moves

    def _signatures(self, node: Explanation) -> list[Signature]:
        """How the readings change with each effect that may act beside those of a node."""
        estimate = node.fit.linearisation.sinkage_at(np.zeros((1, len(node.fit.x))))
        others = self.problem.effects_beside(node.hypothesis.effects)
        case, readings = node.fit.fitted(), self.problem.readings
        found, untestable = effect_signatures(case, readings, others, estimate)
        if node.hypothesis == SOIL_ALONE:
            self.untestable = untestable
        self.signatures[node.hypothesis.effects] = found
        return found

    def _by_catalogue(
        self, node: Explanation, start: Mapping[str, float]
    ) -> dict[Hypothesis, Prediction]:
        """The hypothesis by the catalogue's laws, where that with free ones is a node.

        Whether the catalogue's laws explain too decides how far free ones count for an effect.
        """
        if not node.hypothesis.free_law:
            return {}
        own = replace(node.hypothesis, free_law=False)
        return {own: Prediction(node.value, start, node.at, node.outliers)}

    def _opened(
        self, node: Explanation, start: Mapping[str, float]
    ) -> dict[Hypothesis, Prediction]:
        """The hypothesis with the priors of its soil opened, where that can matter.

        The fit presses against one of them, or a large discrepancy is left.
        """
        h, problem = node.hypothesis, self.problem
        if h.wide_priors or problem.wide_soil == problem.soil:
            return {}
        ends = [
            min(x - c.lower, c.upper - x)
            for c, x in zip(node.fit.coordinates, node.fit.x, strict=True)
            if not c.effect
        ]
        large = self.terms.amplitude(node.at).max(initial=0.0) > LARGE_DISCREPANCY
        if min(ends, default=1.0) >= constants.PRESSED and not large:
            return {}
        values = node.fit.values()
        opened = {
            c.path: float(
                np.clip(
                    c.prior.fraction(values.get(c.path, c.nominal)), OFF_BOUNDS, 1.0 - OFF_BOUNDS
                )
            )
            for c in problem.wide_soil
        }
        wide = replace(h, wide_priors=True)
        return {wide: Prediction(node.value, {**start, **opened}, node.at, node.outliers)}


def _careful(
    problem: LeastSquaresProblem,
    first: Floats,
    zero: Floats,
    near: Linearisation | None,
    tolerance: Tolerance,
) -> Asking[Solution]:
    """One fit; where the model refuses its trials, again from effects at zero."""
    try:
        return (yield from descent(problem, first, near, tolerance))
    except InputError:
        return (yield from descent(problem, zero, None, tolerance))


def _distance(terms: GaussianTerms, a: Hyperparameters, b: Hyperparameters) -> float:
    """Largest change of the logarithm of a hyperparameter that matters to a fit."""
    if a.present != b.present or a.autocorrelation != b.autocorrelation:
        return float("inf")
    change = np.abs(a.log - b.log)
    of_terms = np.arange(len(change)) < terms.groups
    smaller, larger = np.exp(np.minimum(a.log, b.log)), np.maximum(a.log, b.log)
    change = np.where(of_terms & (smaller < SMALL) & (larger < USUAL), OF_SMALL * change, change)
    if not a.present:
        change = np.where(terms.of_kind(DISCREPANCY), 0.0, change)
    return float(change.max())
