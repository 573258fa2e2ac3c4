"""Plate and shear tests beside the soil of a gap analysis."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from soilml.config.case import Case
from soilml.physics.soils.soil_tests import SoilTest, deviations
from soilml.results import EstimatedValue


@dataclass(frozen=True)
class SoilTestAgreement:
    """A plate or shear test, and the same quantity by the soil before and after.

    `sigma_before` and `sigma_after` are the distances in standard deviations of the logarithm.
    """

    label: str
    unit: str
    measured: float
    before: float
    after: float
    sigma_before: float
    sigma_after: float


def soil_test_agreement(
    case: Case, before: Mapping[str, EstimatedValue], after: Mapping[str, EstimatedValue]
) -> list[SoilTestAgreement]:
    """The agreement of each test of the case, with the soil's estimates by name."""

    def distance(test: SoilTest, soil: Mapping[str, EstimatedValue]) -> float:
        values = np.asarray([estimate.value for estimate in soil.values()])
        return float(deviations([test], case.soil, list(soil), values)[0])

    found = []
    for test in case.soil_tests:
        first, last = distance(test, before), distance(test, after)
        found.append(
            SoilTestAgreement(
                label=test.label(),
                unit=test.unit,
                measured=test.measured,
                before=test.measured * float(np.exp(first * test.scatter)),
                after=test.measured * float(np.exp(last * test.scatter)),
                sigma_before=first,
                sigma_after=last,
            )
        )
    return found
