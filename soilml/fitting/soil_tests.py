"""Plate and shear tests of the soil: as terms of a fit, and remarks on them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.fitting.coordinates import Coordinate, rates_at, values_at
from soilml.physics.soils.soil_tests import deviation_rates, deviations
from soilml.remarks import Remark

#: Deviation, in standard deviations of the test's scatter, that is remarked on.
NOTABLE = 2.5


@dataclass(frozen=True)
class SoilTestTerms:
    """Deviations of the soil from the tests of a case, at coordinates of a fit.

    Each is a residual of unit variance beside those of the readings. It has neither discrepancy nor
    scatter from run to run: its own scatter contains that from place to place.
    """

    case: Case | None = None
    coordinates: Sequence[Coordinate] = ()

    def deviation(self, x: Floats) -> Floats:
        """Deviations (..., t) at coordinates x (..., p), in standard deviations."""
        if self.case is None or not self.case.soil_tests:
            return np.zeros((*x.shape[:-1], 0))
        names = [c.path for c in self.coordinates]
        values = values_at(self.coordinates, x)
        return deviations(self.case.soil_tests, self.case.soil, names, values)

    def rates(self, x: Floats) -> Floats:
        """Derivatives (t, p) of the deviations at coordinates x (p,)."""
        if self.case is None or not self.case.soil_tests:
            return np.zeros((0, len(x)))
        names = [c.path for c in self.coordinates]
        values, rates = values_at(self.coordinates, x), rates_at(self.coordinates, x)
        return deviation_rates(self.case.soil_tests, self.case.soil, names, values) * rates


def disagreeing_soil_tests(case: Case, values: Mapping[str, float]) -> list[str]:
    """Each test of the case that a soil with these values is far from, in words."""
    at = np.asarray(list(values.values()))
    each = deviations(case.soil_tests, case.soil, list(values), at)
    return [
        f"{test.label()} was {_kpa(test.measured)} kPa in the test, and is "
        f"{_kpa(test.measured * np.exp(z * test.scatter))} kPa by the fitted soil "
        f"({abs(z):.1f} standard deviations)"
        for test, z in zip(case.soil_tests, each, strict=True)
        if abs(z) > NOTABLE
    ]


def ignored_soil_tests(case: Case) -> list[Remark]:
    """A remark that a file for the board ignores the case's tests; none for a case without."""
    if not case.soil_tests:
        return []
    text = "[[soil.test]] is ignored: a file for the board takes no tests of the soil"
    return [Remark("soil-tests-ignored", text)]


def _kpa(stress: float) -> str:
    return f"{1e-3 * stress:.3g}"
