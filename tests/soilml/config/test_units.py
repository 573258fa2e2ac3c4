"""Values with units in a model file, and what is said of wrong ones."""

import numpy as np
import pytest

from soilml import read_case
from soilml.errors import InputError
from soilml.io.declared_settings import UNITS
from soilml.parameters import declared
from soilml.physics.effects import EFFECTS
from soilml.physics.gears import GEARS
from soilml.physics.soils import Soil

MODEL = """
[gear]
type = "wheel"
radius = "15 cm"
width = "120 mm"
[soil]
name = "wong1989/dry_sand"
cohesion = "1.04 kPa"
friction_angle = "28 deg"
kphi = "1528 kN/m^(n+2)"
[soil.prior]
cohesion = [0.0, "3 kPa"]
friction_angle = ["25 deg", "45°"]
shear_modulus = { range = ["5 mm", "3 cm"], scale = "log" }
[[effect]]
name = "torque-offset"
[effect.prior]
offset = { normal = "200 mNm" }
"""


@pytest.fixture
def file(model_file):
    model_file.write_text(MODEL)
    return model_file


def test_units_are_converted(file):
    case = read_case(file)
    assert (case.model.gear.radius, case.model.gear.width) == (0.15, pytest.approx(0.12))
    assert (case.soil.cohesion, case.soil.kphi) == (1040.0, pytest.approx(1.528e6))
    assert np.rad2deg(case.soil.friction_angle) == pytest.approx(28.0)
    prior = case.prior
    assert (prior["cohesion"].lower, prior["cohesion"].upper) == (0.0, 3000.0)
    ends = np.rad2deg([prior["friction_angle"].lower, prior["friction_angle"].upper])
    assert ends == pytest.approx([25.0, 45.0])
    assert (prior["shear_modulus"].lower, prior["shear_modulus"].upper) == (0.005, 0.03)
    assert prior["torque-offset.offset"].normal_std == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"28 deg"', '"28 dg"', "friction_angle is '28 dg'; needed is a number in rad, or a text"),
        ('"28 deg"', '"28 kPa"', "one of the units rad, mrad, deg"),
        ('"28 deg"', '"deg"', "friction_angle is 'deg'"),
        ('"28 deg"', '"1.2.3 deg"', r"friction_angle is '1\.2\.3 deg'"),
        ('"28 deg"', '"280 deg"', "friction_angle"),
        ('"28 deg"', "28", "friction_angle"),
        ('"3 kPa"', '"3 kPa/m"', "cohesion is '3 kPa/m'"),
        ('"200 mNm"', '"200 mm"', "offset is '200 mm'; needed is a number in N m"),
    ],
)
def test_wrong_units_are_told(file, old, new, said):
    file.write_text(MODEL.replace(old, new))
    with pytest.raises(InputError, match=said):
        read_case(file)


def test_every_declared_unit_is_known():
    classes = [Soil, *GEARS.values(), *EFFECTS.values()]
    units = {parameter.unit for cls in classes for parameter in declared(cls).values()}
    assert units <= set(UNITS), units - set(UNITS)
