"""The fit problem: data, covariance and catalogue, which all candidate fits share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.errors import InputError
from soilml.gap.data.stacked_readings import StackedReadings
from soilml.gap.statistics.coordinates import (
    EffectCoordinate,
    FitCoordinate,
    SoilCoordinate,
    shape_coordinates,
    size_coordinate,
)
from soilml.gap.statistics.discrepancy_process import discrepancy_process
from soilml.gap.statistics.evidence import DiscrepancyModel, Evidence
from soilml.gap.statistics.least_squares import GapFit, levenberg_marquardt
from soilml.gap.statistics.reml_covariance import Covariance
from soilml.gap.statistics.signatures import current_size, with_effect
from soilml.physics.effects.base import Effect

Floats = NDArray[np.float64]

#: Size, in reference sizes, from which the fit of a new effect starts: away from zero, where the
#: derivative of some effects vanishes.
START_SIZE = 0.7
#: Prior standard deviation of the error of a sensor or rig without calibration, in reference sizes.
UNCALIBRATED_STD = 2.0
#: Range of slip, and of log load, above which a shape coefficient can be estimated.
MIN_SLIP_RANGE, MIN_LOG_LOAD_RANGE = 0.05, 0.1


#: Fits at most under successive estimates of the discrepancy; the estimate of the amplitudes hardly
#: changes after the second.
MAX_ROUNDS = 3
#: Change of an amplitude, in usual ones and relative to itself, below which a fit is final: the
#: weights of the readings then hardly change.
AMPLITUDE_TOLERANCE, AMPLITUDE_RATIO = 0.3, 0.7

#: Case, coordinates, start coordinates by path, and amplitudes of the discrepancy to start with.
FitRequest = tuple[Case, Sequence[FitCoordinate], Mapping[str, float], Floats]


@dataclass(frozen=True)
class MarginalFit:
    """A fit under the discrepancy that its own evidence supports."""

    fit: GapFit
    evidence: Evidence


@dataclass(frozen=True)
class FitProblem:
    """Everything that stays the same while candidates are fitted.

    `covariance` is that of noise and run-to-run scatter; `discrepancy` adds a smooth discrepancy.
    `calibration` holds standard deviations of sensor and rig errors by effect name, in the unit of
    the effect's size.
    """

    case: Case
    soil: tuple[SoilCoordinate, ...]
    readings: StackedReadings
    covariance: Covariance
    effects: Mapping[str, type[Effect]]
    calibration: Mapping[str, float]

    @cached_property
    def discrepancy(self) -> DiscrepancyModel:
        """Noise, scatter and a smooth discrepancy of the readings."""
        return DiscrepancyModel(self.covariance, discrepancy_process(self.readings))

    def effects_not_in(self, fit: GapFit) -> dict[str, type[Effect]]:
        """The effects of the catalogue without coordinates in a fit."""
        fitted = {c.effect for c in fit.coordinates if isinstance(c, EffectCoordinate)}
        return {name: effect for name, effect in self.effects.items() if name not in fitted}

    def with_effects(self, names: Sequence[str]) -> Case:
        """The case with these effects added."""
        case = self.case
        for name in names:
            case = with_effect(case, self.effects[name])
        return case

    def size_coordinates(self, names: Sequence[str]) -> list[EffectCoordinate]:
        """The coordinates of the effects' sizes; sensor and rig errors have a Gaussian prior."""
        coordinates = []
        for name in names:
            about = self.effects[name].about
            default = UNCALIBRATED_STD * about.reference[about.size] if about.calibration else None
            std = self.calibration.get(name, default)
            coordinates.append(size_coordinate(self.effects[name], std))
        return coordinates

    def shape_coordinates(self, names: Sequence[str]) -> list[EffectCoordinate]:
        """The coordinates of the effects' shapes that the range of slip and load can determine."""
        varies = {
            "by_slip": np.ptp(self.readings.slip) > MIN_SLIP_RANGE,
            "by_load": bool(np.ptp(np.log(self.readings.load)) > MIN_LOG_LOAD_RANGE),
        }
        shapes = [c for name in names for c in shape_coordinates(self.effects[name])]
        return [c for c in shapes if varies[c.name]]

    def fit_soil(self, starts: Sequence[Floats]) -> GapFit:
        """The best of the fits of the soil alone, one from each start."""
        fits = [
            levenberg_marquardt(self.case, self.soil, self.readings, self.covariance.whiten, start)
            for start in starts
        ]
        return min(fits, key=lambda fit: fit.objective)

    def fit_marginal(self, requests: Sequence[FitRequest]) -> list[MarginalFit]:
        """Fits and their evidence, each under the discrepancy that it supports itself."""
        amplitudes = [amplitude for *_, amplitude in requests]
        starts = [start for _, _, start, _ in requests]
        found: dict[int, MarginalFit] = {}
        waiting = list(range(len(requests)))
        for _ in range(MAX_ROUNDS):
            for i in waiting:
                case, coordinates, *_ = requests[i]
                whiten = self.discrepancy.whiten(amplitudes[i])
                fit = self._fit(case, coordinates, starts[i], whiten)
                found[i] = MarginalFit(fit, self.discrepancy.evidence(fit, amplitudes[i]))
            waiting = [i for i in waiting if _changed(amplitudes[i], found[i].evidence.amplitude)]
            for i in waiting:
                amplitudes[i] = found[i].evidence.amplitude
                starts[i] = found[i].fit.start_values()
            if not waiting:
                break
        return [found[i] for i in range(len(requests))]

    def _fit(
        self,
        case: Case,
        coordinates: Sequence[FitCoordinate],
        start: Mapping[str, float],
        whiten: Floats,
    ) -> GapFit:
        """Fit from `start`, by path; other coordinates start at the case's value or small.

        Where the model refuses a trial from there, the fit starts again with all effects at zero.
        """
        first = np.asarray([start.get(c.path, self._default_start(c)) for c in coordinates])
        try:
            return levenberg_marquardt(case, coordinates, self.readings, whiten, first)
        except InputError:
            zero = np.asarray(
                [
                    start.get(c.path, 0.0) if isinstance(c, SoilCoordinate) else 0.0
                    for c in coordinates
                ]
            )
            return levenberg_marquardt(case, coordinates, self.readings, whiten, zero)

    def _default_start(self, coordinate: FitCoordinate) -> float:
        """The case's own value of an effect's size, else a size off zero; shapes start at zero."""
        if isinstance(coordinate, EffectCoordinate) and coordinate.is_shape:
            return 0.0
        if coordinate.path in self.case.parameters():
            return current_size(self.case, coordinate.path, coordinate.prior.upper)
        return START_SIZE if coordinate.upper > 0.0 else -START_SIZE


def _changed(before: Floats, after: Floats) -> bool:
    """Whether the amplitudes of a discrepancy changed so much that a fit must be repeated."""
    larger, smaller = np.maximum(before, after), np.minimum(before, after)
    changed = (larger - smaller > AMPLITUDE_TOLERANCE) & (smaller < AMPLITUDE_RATIO * larger)
    return bool(changed.any())
