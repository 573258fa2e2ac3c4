"""The soil as it is written in a model file: its parameters, their priors, and tests of it."""

from __future__ import annotations

from soilml.config.model_settings import take_instance, take_priors
from soilml.config.units import take_quantity
from soilml.errors import InputError
from soilml.io.toml_settings import Settings
from soilml.numerics.prior import Prior
from soilml.parameters import check, declared, with_values
from soilml.physics.soils import Soil, soil
from soilml.physics.soils.soil_tests import PlatePressure, ShearStrength, SoilTest

#: Kinds of tests; the key of the measured quantity tells which one a table is.
_KINDS: tuple[type[SoilTest], ...] = (PlatePressure, ShearStrength)


def take_soil(settings: Settings) -> tuple[Soil, dict[str, Prior], tuple[SoilTest, ...]]:
    """The soil in a table [soil], its priors by name, and the tests in [[soil.test]]."""
    priors = settings.table("prior")
    tests = tuple(_take_test(entry) for entry in settings.tables("test"))
    if "name" in settings:
        name = settings.text("name")
        try:
            base = soil(name)
        except InputError as error:
            settings.fail(str(error))
        values = {
            key: take_quantity(settings, key, parameter.unit)
            for key, parameter in declared(Soil).items()
            if key in settings
        }
        settings.permit(declared(Soil))
        made = with_values(base, values)
        check(made, f"{settings.where}: ")
    else:
        made = take_instance(Soil, settings)
    settings.finish()
    return made, take_priors(priors, Soil), tests


def _take_test(settings: Settings) -> SoilTest:
    kinds = [kind for kind in _KINDS if kind.quantity in settings]
    if len(kinds) != 1:
        settings.fail(
            "needed is pressure (Pa), with plate_width and sinkage, or strength (Pa), with "
            "normal_stress; and scatter, such as '15 %'"
        )
    made: SoilTest = take_instance(kinds[0], settings)
    settings.finish()
    return made
