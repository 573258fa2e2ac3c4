"""Fits of the model with effects added: by their own law, and with the law left open."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.errors import InputError
from soilml.gap.data.observations import Cells
from soilml.gap.statistics.coordinates import SHAPE_STD, Axis, shape_axes, size_axis
from soilml.gap.statistics.least_squares import GapFit, descend
from soilml.gap.statistics.reml_covariance import Covariance
from soilml.gap.statistics.score_test import outside
from soilml.gap.statistics.signatures import grown, standing
from soilml.physics.effects.base import Effect

Floats = NDArray[np.float64]

#: Sizes, in reference sizes, that a fit of a new effect starts from.
STARTS = (0.7,)
#: Spread of the fault of a sensor or rig that nobody checked, in reference sizes.
UNCHECKED = 2.0


@dataclass(frozen=True)
class Candidate:
    """Effects by name and the two fits with them: by their own laws, and with shapes free."""

    names: tuple[str, ...]
    strict: GapFit
    shaped: GapFit

    @property
    def price(self) -> float:
        r"""What free shapes must gain before they are believed: their Occam factor.

        .. math:: \sum_k \ln(1 + \sigma_k^2 / s_k^2)

        with the spreads of the prior and of the posterior. References: MacKay, Neural Computation
        4, 1992.
        """
        prior = self.shaped.precision
        shapes = [i for i, a in enumerate(self.shaped.axes) if _is_shape(a)]
        spread = np.diag(self.shaped.covariance)[shapes]
        return float(np.sum(np.log1p(1.0 / (prior[shapes] * np.maximum(spread, 1e-12)))))

    @property
    def open(self) -> bool:
        """Whether the data ask for another law than the catalogue's."""
        return self.shaped.cost + self.price < self.strict.cost

    @property
    def cost(self) -> float:
        """The objective with form uncertainty included."""
        return min(self.strict.cost, self.shaped.cost + self.price)

    @property
    def fit(self) -> GapFit:
        """The fit that stands for the candidate."""
        return self.shaped if self.open else self.strict

    @property
    def strain(self) -> float:
        """How far the shapes are from the catalogue's law, in squared prior spreads."""
        x, prior = self.fit.x, self.fit.precision
        shapes = [i for i, a in enumerate(self.fit.axes) if _is_shape(a)]
        return float(np.sum(x[shapes] ** 2 * prior[shapes]))


@dataclass(frozen=True)
class Bench:
    """All that stays the same while candidates are tried."""

    case: Case
    soil: tuple[Axis, ...]
    cells: Cells
    covariance: Covariance
    effects: Mapping[str, type[Effect]]
    calibration: Mapping[str, float]

    def others(self, fit: GapFit) -> dict[str, type[Effect]]:
        """The effects whose size is not among the coordinates of a fit."""
        fitted = {axis.path.rpartition(".")[0] for axis in fit.axes}
        return {name: effect for name, effect in self.effects.items() if name not in fitted}

    def with_effects(self, names: Sequence[str]) -> Case:
        """The case with these effects added."""
        case = self.case
        for name in names:
            case = grown(case, self.effects[name])
        return case

    def sizes(self, names: Sequence[str]) -> list[Axis]:
        """The axes of the effects' sizes."""
        found = []
        for name in names:
            about = self.effects[name].about
            usual = UNCHECKED * about.reference[about.size] if about.calibration else None
            found.append(size_axis(self.effects[name], self.calibration.get(name, usual)))
        return found

    def shapes(self, names: Sequence[str]) -> list[Axis]:
        """The axes of the effects' shapes, as far as slip and load vary."""
        found = [axis for name in names for axis in shape_axes(self.effects[name])]
        varies = {"by_slip": np.ptp(self.cells.slip) > 0.05, "by_load": self._loads()}
        return [axis for axis in found if varies[axis.path.rpartition(".")[2]]]

    def _loads(self) -> bool:
        return bool(np.ptp(np.log(self.cells.load)) > 0.1)

    def soil_only(self, starts: Sequence[Floats]) -> GapFit:
        """The best fit of the soil alone."""
        fits = [
            descend(self.case, self.soil, self.cells, self.covariance.whiten, start)
            for start in starts
        ]
        return min(fits, key=lambda fit: fit.cost)

    def fit(self, names: Sequence[str], start: Mapping[str, float]) -> Candidate:
        """The model with these effects, each by its own law; coordinates not given start small."""
        strict = self._from(self.with_effects(names), [*self.soil, *self.sizes(names)], start)
        return Candidate(tuple(names), strict, strict)

    def loosened(self, candidate: Candidate) -> Candidate:
        """The same candidate with the shapes of its effects free as well."""
        strict = candidate.strict
        shapes = self.shapes(candidate.names)
        if not shapes:
            return candidate
        loose = self._from(strict.case, [*strict.axes, *shapes], coordinates(strict))
        return candidate if loose.cost > strict.cost else replace(candidate, shaped=loose)

    def forms(self, fit: GapFit) -> list[Floats]:
        """What further bends in the laws of a fit's effects would do, whitened, (m, k) each."""
        raw = [
            fit.slope[:, i]
            for i, axis in enumerate(fit.axes)
            if "." in axis.path
            and shape_axes(self.effects[axis.path.rpartition(".")[0]])
            and not _is_shape(axis)
        ]
        if not raw:
            return []
        s, w = self.cells.slip, np.log(self.cells.load)
        s, w = s - s.mean(), w - w.mean()
        plain = np.linalg.solve(self.covariance.whiten, np.stack(raw, axis=1))
        return [self.covariance.whiten @ (plain * f[:, None]) for f in (s * s, s * w, w * w)]

    def loose_gain(self, candidate: Candidate) -> float:
        """By how much free shapes should lower the objective at most: linearised, no prior."""
        fit = candidate.strict
        forms = (self.cells.slip, np.log(self.cells.load))
        raw = np.linalg.solve(self.covariance.whiten, fit.slope[:, len(self.soil) :])
        columns = np.column_stack([raw * form[:, None] for form in forms])
        beyond = outside(self.covariance.whiten @ columns, fit.slope)
        u, s, _ = np.linalg.svd(beyond, full_matrices=False)
        kept = u[:, s > 1e-9 * max(float(s[0]), 1e-300)]
        return float(np.sum((kept.T @ fit.residual) ** 2))

    def _first(self, axis: Axis) -> float:
        """Where a coordinate starts: where the case has it, else a little off zero."""
        if axis.path in self.case.parameters() and not _is_shape(axis):
            return standing(self.case, axis.path, axis.prior.upper)
        return _small(axis)

    def _from(self, case: Case, axes: Sequence[Axis], start: Mapping[str, float]) -> GapFit:
        begin = np.asarray([start.get(axis.path, self._first(axis)) for axis in axes])
        try:
            return descend(case, axes, self.cells, self.covariance.whiten, begin)
        except InputError:  # a trial past what the model allows: start from nothing
            begin = np.asarray([start.get(a.path, 0.0) if "." not in a.path else 0.0 for a in axes])
            return descend(case, axes, self.cells, self.covariance.whiten, begin)


def _is_shape(axis: Axis) -> bool:
    return axis.path.rpartition(".")[2] in SHAPE_STD


def _small(axis: Axis) -> float:
    """Where a new coordinate starts: off zero, where some effects have no slope."""
    if _is_shape(axis):
        return 0.0
    return STARTS[0] if axis.upper > 0.0 else -STARTS[0]


def coordinates(fit: GapFit) -> dict[str, float]:
    """Where a fit stands, by path, for another to start from."""
    return {axis.path: float(x) for axis, x in zip(fit.axes, fit.x, strict=True)}
