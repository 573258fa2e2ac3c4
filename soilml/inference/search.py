"""One search: fit, estimate hyperparameters, predict every addition, fit what is within reach.

A node is a hypothesis that was fitted. From each node near the best one, the evidence of every
addition (an effect, free laws, opened priors) is predicted by a linear model, under a ladder of
hyperparameters that it may lead to: as fitted, without discrepancy, with less of it. The best are
fitted, in turn with their hyperparameters, until nothing is left to fit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.errors import InputError
from soilml.fitting.coordinates import Coordinate
from soilml.fitting.covariance import noise_of_operation
from soilml.fitting.damped_descents import COARSE, FINE, Tolerance, descend
from soilml.fitting.effect_signatures import Signature, current_size
from soilml.fitting.least_squares import LeastSquaresProblem, Solution
from soilml.inference import constants
from soilml.inference.additions import additions
from soilml.inference.conditional import leave_one_out
from soilml.inference.evidence import linear_model
from soilml.inference.explanation import Explanation, StartedFit
from soilml.inference.gaussian_terms import (
    DISCREPANCY,
    FIRST_AMPLITUDE,
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
#: Step of the ladder, of the logarithm of the discrepancy.
LESS_DISCREPANCY = 1.0
#: Amplitudes and scatter below the first (the logarithm below the second) count less where they
#: change.
SMALL, USUAL, OF_SMALL = 0.3, -0.5, 0.2
#: Readings that are taken as outliers in one estimate, at most.
MOST_OUTLIERS = 12


@dataclass(eq=False)
class Search:
    """The nodes of a problem, and the predicted values of other hypotheses."""

    problem: InferenceProblem
    progress: Callable[[float], None] = lambda _: None
    nodes: dict[Hypothesis, Explanation] = field(default_factory=dict)
    predicted: dict[Hypothesis, StartedFit] = field(default_factory=dict)
    #: Why the rows cannot test some effects, by name, and signatures of others beside effects
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
        answers = [self.fit(job) for job in jobs]
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
        kept = [f for f in carried if f.objective < best.objective + constants.NEAR_AT_FIRST]
        first = self.terms.first()
        jobs = [
            StartedFit(SOIL_ALONE, f.start_values(), first, none, f.linearisation) for f in kept
        ]
        self._settle(jobs, float("inf"))
        if not self.nodes:
            raise InputError("the model cannot be fitted to these rows")
        self._choose_autocorrelation(self.nodes[SOIL_ALONE])

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

    def beside(self, fixed: Floats, inner: Sequence[Floats]) -> Search:
        """The hypotheses that are drawn from, fitted beside further Gaussian terms.

        fixed (m, k): Columns of unit variance.
        inner: Columns (m, q) of discrepancies, each of which has an amplitude of its own.
        """
        known, first = self.terms, self.terms.channels
        terms = gaussian_terms(
            known.readings, self.problem.case, known.scatter_change, fixed, inner
        )
        found = Search(self.problem)
        found.terms = terms

        def at(own: Hyperparameters) -> Hyperparameters:
            return replace(own, log=np.insert(own.log, first, np.full(len(inner), FIRST_AMPLITUDE)))

        worst = self.lowest - 2.0 * float(np.log(constants.LEAST_DRAWN))
        jobs = [
            StartedFit(h, n.fit.start_values(), at(n.at), n.outliers, n.fit.linearisation)
            for h, n in self.nodes.items()
            if n.value < worst or h == SOIL_ALONE
        ]
        found._settle(jobs, float("inf"))
        return found

    # ---- fits

    def fit(self, job: StartedFit, tolerance: Tolerance = COARSE) -> Solution | InputError:
        """The fit of a job; the error where the model refuses it twice."""
        coordinates = self.problem.coordinates(job.hypothesis)
        whiten, case = self.terms.whiten(job.at, job.outliers), self.problem.case_of(job.hypothesis)
        own = LeastSquaresProblem(case, coordinates, self.problem.readings, whiten)
        first = [job.start.get(c.path, self._first_size(c)) for c in coordinates]
        zero = [0.0 if c.of_candidate else job.start.get(c.path, 0.5) for c in coordinates]
        known = job.near if job.near and len(job.near.x) == len(coordinates) else None
        answer: Solution | InputError
        for start, near in ((first, known), (zero, None)):  # again from effects at zero
            try:
                return descend(own, np.asarray(start), tolerance, near)
            except InputError as error:
                answer = error
        return answer

    def _first_size(self, coordinate: Coordinate) -> float:
        """The case's own value of an effect's size, else a size off zero; shapes start at zero."""
        if not coordinate.of_candidate:
            return 0.5
        if coordinate.is_shape:
            return 0.0
        if coordinate.path in self.problem.case.parameters():
            own = coordinate.reference_size
            return current_size(self.problem.case, coordinate.path, own)
        return constants.START_SIZE if coordinate.upper > 0.0 else -constants.START_SIZE

    def node(
        self,
        hypothesis: Hypothesis,
        fit: Solution,
        at: Hyperparameters,
        outliers: Booleans,
        known: Explanation | None = None,
    ) -> Explanation:
        """A fit with the hyperparameters of its largest evidence, with and without discrepancy.

        known: An earlier fit, near whose hyperparameters they are looked for, and not near `at`.
        """
        linear = linear_model(self.terms, fit, outliers)
        starts = (known.beside.at, known.without.at) if known else (at, at)
        beside, without = (
            linear.evidence(linear.best(replace(start, present=present)))
            for start, present in zip(starts, (True, False), strict=True)
        )
        prior = constants.DISCREPANCY_PRIOR
        node = Explanation(hypothesis, fit, linear, beside, without, 0.0, outliers)
        log = np.logaddexp(
            np.log(prior) - 0.5 * beside.trusted, np.log(1.0 - prior) - 0.5 * without.trusted
        )
        node.value = float(-2.0 * log) + self.problem.penalty(hypothesis)
        return node

    def _settle(self, jobs: Sequence[StartedFit], lowest: float) -> None:
        """Fit, estimate hyperparameters, and repeat while these move and the node is near.

        lowest: The value of the best node so far.
        """
        found: dict[Hypothesis, Explanation] = {}
        for turn in range(constants.FITS_IN_TURN):
            again = []
            for job in jobs:
                fit = self.fit(job, COARSE if turn == 0 else FINE)
                if isinstance(fit, InputError) or not np.isfinite(fit.prediction).all():
                    continue
                try:
                    known = found.get(job.hypothesis)
                    node = self.node(job.hypothesis, fit, job.at, job.outliers, known)
                    if node.value < lowest + constants.NEAR:
                        outliers = self._outliers(node)
                        if (outliers != job.outliers).any():
                            node = self.node(job.hypothesis, fit, node.at, outliers, node)
                except np.linalg.LinAlgError:
                    continue
                if known is None or node.value < known.value:
                    found[job.hypothesis] = node
                lowest = min(lowest, node.value)
                target = node.promising.at
                moved = _distance(self.terms, job.at, target) > constants.WORTH_A_FIT
                moved = moved or bool((node.outliers != job.outliers).any())
                promised = node.promising.promised > constants.WORTH_A_FIT
                if node.hoped < lowest + constants.NEAR and (moved or promised):
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
            error, variance = leave_one_out(node.linear.without(strays), node.at)
            wide = variance + width**2
            usual = -0.5 * (error**2 / variance + np.log(variance))
            far = -0.5 * (error**2 / wide + np.log(wide)) + odds
            gain = np.where(strays, usual - far, far - usual)
            i = int(np.argmax(gain))
            if gain[i] < constants.WORTH_A_FIT:
                break
            strays[i] = not strays[i]
        return strays

    # ---- proposals

    def _proposed(self, *, first: bool) -> list[StartedFit]:
        """The fits of the next round; in the first one the best single effects in any case."""
        lowest = self.lowest
        near = sorted(self.nodes.values(), key=lambda node: node.value)
        near = [node for node in near if node.value < lowest + constants.NEAR][: constants.EXTENDED]
        for node in {id(n): n for n in (*near, self.nodes[SOIL_ALONE])}.values():
            if node.extended:
                continue
            node.extended = True
            for hypothesis, own in additions(self, node, self._ladder(node)).items():
                known = self.predicted.get(hypothesis)
                if known is None or own.value < known.value:
                    self.predicted[hypothesis] = own
        done = {*self.nodes, *self._tried}
        left = sorted((p for h, p in self.predicted.items() if h not in done), key=_by_value)
        single = [p for p in left if len(p.hypothesis.effects) == 1]
        reach = {True: lowest + constants.NEAR, False: lowest + constants.NEAR_SET}
        chosen = [p for p in left if p.value < reach[len(p.hypothesis.effects) <= 1]]
        chosen = chosen[: constants.FITS] + (single[: constants.FITS // 2] if first else [])
        return sorted(set(chosen), key=_by_value)

    def _ladder(self, node: Explanation) -> list[Hyperparameters]:
        """Hyperparameters that an addition may lead to: those of a node, or less discrepancy."""
        beside = node.beside.at
        own = self.terms.of_kind(DISCREPANCY)
        less = np.where(own, beside.log - LESS_DISCREPANCY, beside.log)
        return [beside, node.without.at, replace(beside, log=less)]


def _by_value(predicted: StartedFit) -> tuple[float, Hypothesis]:
    """What predictions are ordered by: their values, then their hypotheses."""
    return predicted.value, predicted.hypothesis


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
