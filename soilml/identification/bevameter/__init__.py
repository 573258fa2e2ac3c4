"""Soil parameters from plate-sinkage and shear tests, without a wheel."""

from __future__ import annotations

from soilml.config.case import Case
from soilml.errors import InputError
from soilml.identification.bevameter.laws import (
    PressureSinkageFit,
    ShearFit,
    fit_pressure_sinkage,
    fit_shear_strength,
)
from soilml.identification.bevameter.remarks import plate_remarks, shear_remarks
from soilml.identification.bevameter.result import BevameterResult
from soilml.identification.bevameter.soil_section import (
    plate_section,
    pressure_test,
    shear_section,
    strength_test,
    within_bounds,
)
from soilml.identification.bevameter.tables import read_plate_tests, read_shear_tests
from soilml.io.read_table import Rows, as_table
from soilml.numerics.prior import Prior
from soilml.physics.soils.soil_tests import SoilTest
from soilml.remarks import Remark
from soilml.report.numbers import round_significant


def bevameter(
    plates: Rows | None = None, shear: Rows | None = None, case: Case | None = None
) -> BevameterResult:
    """Soil parameters from plate-sinkage tests, from shear tests, or from both.

    Parameters
    ----------
    plates
        Plate tests; the columns are those of `read_plate_tests`.
    shear
        Shear tests; the columns are those of `read_shear_tests`.
    case
        Whose gears' widths decide what the plates say of kphi, and whose prior of the cohesion is
        kept where there is one normal stress.

    Returns
    -------
    BevameterResult

    Raises
    ------
    InputError
        Where both tables are missing.
    TableError
        For a missing column, or a test without a usable curve.

    Examples
    --------
    >>> import numpy as np
    >>> from soilml.identification.bevameter import bevameter
    >>> from soilml.io.table import Table
    >>> z, size = np.tile(np.linspace(0.01, 0.1, 8), 2), np.repeat([0.05, 0.10], 8)
    >>> plates = Table({
    ...     "test": np.repeat(["small", "large"], 8),
    ...     "plate_radius_m": size,
    ...     "sinkage_m": z,
    ...     "pressure_Pa": (2000.0 / size + 800e3) * z**0.9,
    ... })
    >>> found = bevameter(plates)
    >>> print(*(f"{name} {value:.4g}" for name, value in found.soil.items()))
    kc 2000 kphi 8e+05 n 0.9
    """
    if plates is None and shear is None:
        raise InputError("no tests: give plate tests, shear tests, or both")
    soil: dict[str, float] = {}
    prior: dict[str, Prior] = {}
    remarks: list[Remark] = []
    plate_fit = shear_fit = None
    tests: list[SoilTest | None] = []
    if plates is not None:
        plate_fit = fit_pressure_sinkage(read_plate_tests(as_table(plates)))
        values, priors, notes = plate_section(plate_fit, case)
        soil, prior = soil | values, prior | priors
        remarks += [*plate_remarks(plate_fit), *notes]
        tests.append(pressure_test(plate_fit, case))
    if shear is not None:
        shear_fit = fit_shear_strength(read_shear_tests(as_table(shear)))
        values, priors, notes = shear_section(shear_fit, case)
        soil, prior = soil | values, prior | priors
        remarks += [*shear_remarks(shear_fit), *notes]
        tests.append(strength_test(shear_fit))
    soil = within_bounds({name: round_significant(value) for name, value in soil.items()})
    kept = tuple(test for test in tests if test is not None)
    return BevameterResult(plate_fit, shear_fit, soil, prior, tuple(remarks), kept)


__all__ = ["BevameterResult", "PressureSinkageFit", "ShearFit", "bevameter"]
