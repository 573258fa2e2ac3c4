"""A model file, or the soil section of one, from plate and shear tests."""

from __future__ import annotations

from dataclasses import replace

from soilml.config.case import Case
from soilml.config.write_case import case_as_toml, soil_as_toml
from soilml.identification.bevameter.result import BevameterResult
from soilml.physics.soils.soil_tests import PlatePressure

#: Soil parameters that plates determine, and those that shear tests determine.
BEARING, SHEARING = ("kc", "kphi", "n"), ("cohesion", "friction_angle", "shear_modulus")


def updated_soil(case: Case, result: BevameterResult) -> Case:
    """The case with the soil of the tests.

    Priors of what they determine, and earlier tests of the same kinds, are replaced.
    """
    determined = (BEARING if result.plates else ()) + (SHEARING if result.shear else ())
    kept = {name: prior for name, prior in case.prior.items() if name not in determined}
    measured = tuple(
        test
        for test in case.soil_tests
        if not (result.plates if isinstance(test, PlatePressure) else result.shear)
    )
    return replace(
        case.with_values(result.soil),
        prior={**kept, **result.prior},
        soil_tests=(*measured, *result.tests),
    )


def model_file_text(result: BevameterResult, case: Case | None, source: str) -> str:
    """The case with this soil as a model file; without a case, the soil alone.

    The remarks become comments; `source` names the tables.
    """
    comments = [f"soil from plate and shear tests: {source}", *result.remarks]
    if case is not None:
        return case_as_toml(updated_soil(case, result), comments)
    return soil_as_toml(result.soil, result.prior, comments, result.tests)


def missing_values(result: BevameterResult) -> list[str]:
    """Parameters of a soil that the tests did not determine and that have no default."""
    return [name for name in (*SHEARING, *BEARING) if name not in result.soil]
