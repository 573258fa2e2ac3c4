"""Tests of the soil that the soil of an answer disagrees with."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from soilml.config.case import Case
from soilml.physics.soils.soil_tests import deviations
from soilml.remarks import Remark

#: Deviation, in standard deviations of the test's scatter, that is remarked on.
NOTABLE = 2.5


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
