"""The fit problem that all explanations share, and its fits beside a smooth discrepancy."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeAlias

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.errors import InputError, raised
from soilml.fitting.candidate_effects import with_effect
from soilml.fitting.coordinates import Coordinate, shape_coordinates, size_coordinate
from soilml.fitting.covariance import Whitening, discrepancy_process
from soilml.fitting.damped_descents import (
    COARSE,
    FINE,
    Asking,
    Tolerance,
    descend_together,
    descent,
    in_step,
)
from soilml.fitting.effect_signatures import Signature, current_size, effect_signatures
from soilml.fitting.least_squares import LeastSquaresProblem, Solution
from soilml.fitting.predictions import Linearisation, linearise_many
from soilml.fitting.readings import Readings
from soilml.gap.evidence.covariance import (
    Covariance,
    assemble_covariance,
    run_effect_columns,
)
from soilml.gap.evidence.marginal_likelihood import DiscrepancyModel, Evidence
from soilml.gap.evidence.prior_odds import effect_penalties
from soilml.physics.effects.base import Effect
from soilml.quantities import column
from soilml.remarks import Remark

#: Size, in reference sizes, from which the fit of a new effect starts: away from zero, where the
#: derivative of some effects vanishes.
START_SIZE = 0.7
#: Prior standard deviation of the error of a sensor or rig without calibration, in reference sizes.
UNCALIBRATED_STD = 2.0
#: Range of slip, and of log load, above which the dependence of an effect on it can be estimated; a
#: load that scatters by this much about one level can suffice.
MIN_SLIP_RANGE, MIN_LOG_LOAD_RANGE = 0.05, 0.1


@dataclass(frozen=True)
class FitProblem:
    """Everything that stays the same while candidates are fitted.

    `covariance` is that of noise and run-to-run scatter; `discrepancy` adds a smooth discrepancy.
    `calibration` has standard deviations of sensor and rig errors by effect name, in the unit of
    the effect's size.
    """

    case: Case
    soil: tuple[Coordinate, ...]
    readings: Readings
    covariance: Covariance
    effects: Mapping[str, type[Effect]]
    calibration: Mapping[str, float]

    @cached_property
    def discrepancy(self) -> DiscrepancyModel:
        """Noise, scatter and a smooth discrepancy of the readings."""
        return DiscrepancyModel(
            self.covariance, discrepancy_process(self.readings, self.case.discrepancy)
        )

    @cached_property
    def declared_amplitude(self) -> Floats:
        """Amplitude of the discrepancy that the case declares by channel, in usual ones: 1 or 0."""
        declared = [column(name) in self.case.discrepancy for name in self.readings.channels]
        return np.asarray(declared, dtype=np.float64)

    @cached_property
    def penalties(self) -> dict[str, float]:
        """-2 ln of the prior odds of each effect against its absence, by name."""
        return effect_penalties(self.effects)

    def penalty(self, names: Sequence[str]) -> float:
        """-2 ln of the prior odds of a set of effects against the soil alone."""
        return sum(self.penalties[name] for name in names)

    def effects_not_in(self, fit: Solution) -> dict[str, type[Effect]]:
        """The effects of the catalogue without coordinates in a fit.

        An effect that all gears share and the same effect of one gear exclude each other, and so do
        two forms of one law.
        """
        fitted = [self.effects[name] for name in fit.effects]
        return {
            name: effect
            for name, effect in self.effects.items()
            if not any(exclude_each_other(effect, other) for other in fitted)
        }

    def signatures_beside(self, fit: Solution) -> list[Signature]:
        """Signatures of the effects that a fit lacks, at the fit; they are kept for each fit."""
        if id(fit) not in self._signatures:
            self._signatures[id(fit)] = fit, self.signatures_and_untestable(fit)[0]
        return self._signatures[id(fit)][1]

    def signatures_and_untestable(self, fit: Solution) -> tuple[list[Signature], dict[str, Remark]]:
        """Signatures of the effects that a fit lacks, and why the runs cannot test the others."""
        estimate = fit.linearisation.sinkage_at(np.zeros((1, len(fit.x))))
        effects = self.effects_not_in(fit)
        return effect_signatures(fit.fitted(), self.readings, effects, estimate)

    @cached_property
    def _signatures(self) -> dict[int, tuple[Solution, list[Signature]]]:
        return {}

    def with_effects(self, names: Sequence[str]) -> Case:
        """The case with these effects added."""
        case = self.case
        for name in names:
            case = with_effect(case, self.effects[name])
        return case

    def size_coordinates(self, names: Sequence[str]) -> list[Coordinate]:
        """The coordinates of the effects' sizes; sensor and rig errors have a Gaussian prior."""
        coordinates = []
        for name in names:
            about = self.effects[name].about
            default = UNCALIBRATED_STD * about.reference[about.size] if about.calibration else None
            std = self.calibration.get(name, default)
            coordinates.append(size_coordinate(self.effects[name], std))
        return coordinates

    def shape_coordinates(self, names: Sequence[str]) -> list[Coordinate]:
        """The coordinates of the effects' shapes that the range of slip and load can determine."""
        slips_vary = np.ptp(self.readings.slip) > MIN_SLIP_RANGE
        varies = {
            "slip_power": slips_vary,
            "by_slip": slips_vary,
            "by_load": bool(np.ptp(np.log(self.readings.load)) > MIN_LOG_LOAD_RANGE),
        }
        shapes = [c for name in names for c in shape_coordinates(self.effects[name])]
        return [c for c in shapes if varies[c.name]]

    def fit_soil(self, starts: Sequence[Floats], near: Linearisation | None = None) -> Solution:
        """The best of the fits of the soil alone, one from each start; `near` may be at one."""
        whiten = self.covariance.whiten
        problem = LeastSquaresProblem(self.case, self.soil, self.readings, whiten)
        fits = descend_together([problem] * len(starts), starts, [near] * len(starts))
        return min((raised(fit) for fit in fits), key=lambda fit: fit.objective)

    def fit(
        self, case: Case, coordinates: Sequence[Coordinate], start: Mapping[str, float]
    ) -> Solution:
        """One fit; see `fit_many`."""
        return raised(fit_many(self, [StartedFit(case, coordinates, start)])[0])

    def first_coordinates(
        self, coordinates: Sequence[Coordinate], start: Mapping[str, float]
    ) -> Floats:
        """Where a fit starts: `start` by path, else the case's value or a small one."""
        return np.asarray([start.get(c.path, self._default_start(c)) for c in coordinates])

    def _default_start(self, coordinate: Coordinate) -> float:
        """The case's own value of an effect's size, else a size off zero; shapes start at zero."""
        if coordinate.is_shape:
            return 0.0
        if coordinate.path in self.case.parameters():
            return current_size(self.case, coordinate.path, coordinate.reference_size)
        return START_SIZE if coordinate.upper > 0.0 else -START_SIZE


@dataclass(frozen=True)
class StartedFit:
    """A fit to be made to a problem's readings, and the coordinates, by path, that it starts at.

    `whiten`, (m, m), replaces the inverse Cholesky factor of the problem's covariance. `near` is
    the linearisation of an earlier fit to the same readings, at its optimum. `useful` is the
    evidence, in -2 ln p, above which the fit will not count.
    """

    case: Case
    coordinates: Sequence[Coordinate]
    start: Mapping[str, float]
    whiten: Whitening | None = None
    near: Linearisation | None = None
    useful: float = float("inf")


def fit_many(
    problem: FitProblem, fits: Sequence[StartedFit], tolerance: Tolerance = FINE
) -> list[Solution | InputError]:
    """Fits that share each call of the model; their results are those of single fits.

    Coordinates without a start begin at the case's value or small. Where the model refuses a trial
    from there, the fit starts again with all effects at zero; where it refuses again, its
    `InputError` takes the place of the fit.
    """
    return in_step([_fit(problem, fit, tolerance) for fit in fits])


def _fit(problem: FitProblem, fit: StartedFit, tolerance: Tolerance = FINE) -> Asking[Solution]:
    """One fit; see `fit_many`."""
    whiten = problem.covariance.whiten if fit.whiten is None else fit.whiten
    own = LeastSquaresProblem(fit.case, fit.coordinates, problem.readings, whiten)
    first = problem.first_coordinates(own.coordinates, fit.start)
    try:
        return (yield from descent(own, first, fit.near, tolerance))
    except InputError:
        first = _without_effects(own.coordinates, fit.start)
        return (yield from descent(own, first, tolerance=tolerance))


def restated(problem: FitProblem, fits: Sequence[Solution]) -> list[Solution]:
    """Fits of an earlier problem at the same values: to its readings, with the priors of its soil.

    Raises `InputError` where the model refuses one of them.
    """
    own, points = [], []
    for fit in fits:
        of_effects, values = [bool(c.effect) for c in fit.coordinates], fit.values()
        effects = [c for c in fit.coordinates if c.effect]
        soil = [c.prior.fraction(values.get(c.path, c.nominal)) for c in problem.soil]
        points.append(np.concatenate([soil, fit.x[of_effects]]))
        coordinates, whiten = [*problem.soil, *effects], problem.covariance.whiten
        own.append(LeastSquaresProblem(fit.case, coordinates, problem.readings, whiten))
    found = linearise_many([one.request(x[None, :]) for one, x in zip(own, points, strict=True)])
    return [one.at(x, raised(y)) for one, x, y in zip(own, points, found, strict=True)]


#: Distance from a bound, as a fraction of the range, at which an estimate counts as at the bound.
AT_BOUND = 1e-3


def within_bounds(fit: Solution) -> Floats:
    """The whitened Jacobian of a fit (m, k) without changes of the soil beyond its priors.

    The columns of coordinates that the fit presses against a bound are zero: they cannot explain
    what is left.
    """
    descent = fit.jacobian.T @ fit.residual
    free = [
        bool(c.effect) or (x - c.lower if slope < 0.0 else c.upper - x) >= AT_BOUND
        for c, x, slope in zip(fit.coordinates, fit.x, descent, strict=True)
    ]
    return np.asarray(fit.jacobian * np.asarray(free, dtype=np.float64))


def covariance_at(problem: FitProblem, fit: Solution, readings: Readings) -> Covariance:
    """The covariance of other readings, by the variance components of the problem."""
    components = problem.covariance.components
    index = {name: i for i, name in enumerate(problem.readings.channels)}
    scale = np.asarray(
        [components.noise_scale[index[n]] if n in index else 1.0 for n in readings.channels]
    )
    columns = run_effect_columns(fit.fitted(), readings)
    return assemble_covariance(readings, columns, replace(components, noise_scale=scale))


def _without_effects(coordinates: Sequence[Coordinate], start: Mapping[str, float]) -> Floats:
    """The coordinates of the soil at their start, those of effects at zero."""
    return np.asarray([start.get(c.path, 0.0) if not c.effect else 0.0 for c in coordinates])


def exclude_each_other(effect: type[Effect], other: type[Effect]) -> bool:
    """Whether two effects cannot be in one set: both act on one gear, as one effect or one family.

    An effect that all gears share acts on each of them.
    """
    (base, _, gear), (other_base, _, other_gear) = (
        own.name.partition("@") for own in (effect, other)
    )
    if gear and other_gear and gear != other_gear:
        return False
    family = effect.about.family
    return base == other_base or (bool(family) and other.about.family == family)


#: Fits at most: coarse or fine, under successive estimates of the discrepancy; the estimate of the
#: amplitudes hardly changes after the second.
MAX_ROUNDS = 4
#: Change of an amplitude, in usual ones and relative to itself, below which a fit is final: the
#: weights of the readings then hardly change.
AMPLITUDE_TOLERANCE, AMPLITUDE_RATIO = 0.3, 0.7
#: Evidence, in -2 ln p above the best, beyond which a fit is not repeated: repetition lowers it by
#: 35 at most, by less than 10 for most fits.
HOPELESS = 40.0
#: The same below which a fit goes on to a fine tolerance: most of what is within reach of the best
#: in a search, which has prior odds too.
NEAR = 15.0
#: Of several starts of one set of coordinates: what a fit must have below the best of the others to
#: go on to a fine tolerance, and above it to be repeated no more.
BETTER, WORSE = 0.1, 10.0


@dataclass(frozen=True)
class MarginalFit:
    """A fit under the discrepancy that its own evidence supports.

    `first` is the fit under the amplitudes of the discrepancy that were started with.
    """

    fit: Solution
    evidence: Evidence
    first: Solution | None = None


def fit_marginal(
    problem: FitProblem,
    requests: Sequence[tuple[StartedFit, Floats]],
    lowest: float = float("inf"),
) -> list[MarginalFit | None]:
    """Fits and their evidence; None where the model refuses the fit.

    Each request has the amplitudes of the discrepancy by channel to start with. Fit and amplitudes
    are repeated in turn until the amplitudes hardly change, for fits whose evidence is not far
    above the lowest so far. The fits are coarse first; useful ones near the lowest go on to a fine
    tolerance, of several starts of one set of coordinates the best. All share the calls of the
    model.

    lowest: Evidence of an earlier fit.
    """
    values: ValuesSoFar = {((), -1): lowest}
    works = [_marginal(problem, *own, number, values) for number, own in enumerate(requests)]
    return [raised(fit) for fit in in_step(works)]


#: Evidence of fits by the paths of their coordinates and their number.
ValuesSoFar: TypeAlias = dict[tuple[tuple[str, ...], int], float]


def _marginal(
    problem: FitProblem, start: StartedFit, amplitude: Floats, number: int, values: ValuesSoFar
) -> Asking[MarginalFit | None]:
    """One fit with its evidence; see `fit_marginal`.

    number: That of the fit among all.
    values: The evidence of all fits so far, to which this one adds.
    """
    found: MarginalFit | None = None
    paths, tolerance = tuple(c.path for c in start.coordinates), COARSE
    for _ in range(MAX_ROUNDS):
        whiten = problem.discrepancy.whiten(amplitude)
        try:
            fit = yield from _fit(problem, replace(start, whiten=whiten), tolerance)
        except InputError:
            break
        evidence = problem.discrepancy.evidence(fit, amplitude)
        value = evidence.value
        if not np.isfinite(value):  # some row has no equilibrium at the optimum
            break
        found = MarginalFit(fit, evidence, found.first if found else fit)
        values[paths, number] = value
        best = min(values.values())
        others = [x for (own, i), x in values.items() if own == paths and i != number]
        other = min(others, default=float("inf"))
        near = value < min(best + NEAR, other - BETTER, start.useful)
        hopeless = value >= best + HOPELESS or value >= other + WORSE
        changed = _changed(amplitude, evidence.amplitude)
        if hopeless or not (changed or (near and tolerance is COARSE)):
            break
        start = replace(start, start=fit.start_values(), near=fit.linearisation)
        tolerance = FINE if near else COARSE
        amplitude = evidence.amplitude if changed else amplitude
    return found


def _changed(before: Floats, after: Floats) -> bool:
    """Whether the amplitudes of a discrepancy changed so much that a fit must be repeated."""
    larger, smaller = np.maximum(before, after), np.minimum(before, after)
    changed = (larger - smaller > AMPLITUDE_TOLERANCE) & (smaller < AMPLITUDE_RATIO * larger)
    return bool(changed.any())
