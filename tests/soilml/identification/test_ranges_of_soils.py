"""Ranges of a soil: from tests at one normal stress, and priors beside those of a model file."""

import math
from types import SimpleNamespace

import pytest

from soilml import Case, Model, Wheel, soil
from soilml.identification.bevameter.soil_section import plate_section, shear_section
from soilml.identification.trained_estimator import SAME_PRIOR, narrower_priors
from soilml.numerics.prior import Prior

WHEEL = Model(Wheel(radius=0.15, width=0.12))


def estimate(value, low, high):
    return SimpleNamespace(value=value, another_place_95=(low, high))


def case(cohesion=None, prior=None, gear=WHEEL, **priors):
    own = soil("wong1989/dry_sand")
    if cohesion is not None:
        own = own.__class__(**{**vars(own), "cohesion": cohesion})
    return Case(gear, own, ({"cohesion": prior} if prior else {}) | priors)


#: Strengths of 3.6 to 4.4 kPa at another place, all under 5 kPa.
ONE_STRESS = SimpleNamespace(
    shear_modulus=estimate(0.02, 0.015, 0.03),
    cohesion=None,
    friction_angle=None,
    stresses=(5000.0,),
    strength=estimate(4000.0, 3600.0, 4400.0),
)


@pytest.mark.parametrize(
    ("given", "cohesion", "c_range", "tangent", "tangents", "whose"),
    [
        (None, 0.0, (0.0, 4400.0), 0.8, (0.0, 0.88), "0 to the whole strength"),
        (case(1000.0, Prior(500.0, 1500.0)), 1000.0, (500.0, 1500.0), 0.6, (0.42, 0.78),
         "the model file's"),
        (case(1000.0, Prior(500.0, 9000.0)), 1000.0, (500.0, 4400.0), 0.6, (0.0, 0.78),
         "the model file's"),
        (case(6000.0, Prior(0.0, 9000.0)), 4400.0, (0.0, 4400.0), 0.0, (0.0, 0.88),
         "the model file's"),
        (case(1000.0), 1000.0, (0.0, 4400.0), 0.6, (0.0, 0.88), "0 to the whole strength"),
    ],
)  # fmt: skip
def test_one_stress_shares_the_strength_between_cohesion_and_friction(
    given, cohesion, c_range, tangent, tangents, whose
):
    values, prior, (remark,) = shear_section(ONE_STRESS, given)
    assert values["cohesion"] == cohesion
    assert values["shear_modulus"] == 0.02
    assert math.tan(values["friction_angle"]) == pytest.approx(tangent, abs=1e-9)
    low, high = prior["cohesion"].lower, prior["cohesion"].upper
    assert (low, high) == pytest.approx(c_range, rel=2e-3, abs=1.0)
    found = [math.tan(prior["friction_angle"].lower), math.tan(prior["friction_angle"].upper)]
    assert found == pytest.approx(list(tangents), rel=2e-3, abs=1e-3)
    assert remark.code == "assumed-range" and whose in remark.text


def plates(sizes=(0.05,), exponent=1.0):
    """A fit of modulus 1e6 Pa/m^n at the first width, falling slowly with width, within 25 %."""
    return SimpleNamespace(
        moduli=(0.0, 1e6),
        exponent=exponent,
        sizes=sizes,
        several_sizes=len(sizes) > 1,
        estimates=lambda: {
            "n": estimate(exponent, 0.9, 1.1),
            "kc": estimate(0.0, -1e3, 1e3),
            "kphi": estimate(1e6, 7e5, 1.4e6),
        },
        modulus=lambda width: estimate(
            *(value * (sizes[0] / width) ** 0.1 for value in (1e6, 8e5, 1.25e6))
        ),
    )


def test_one_plate_leaves_open_how_the_modulus_varies_with_width():
    """A wheel of 0.12 m on a plate of 0.05 m: between k and k times 0.05 / 0.12."""
    values, prior, (remark,) = plate_section(plates(), case())
    assert values == {"kc": 0.0, "kphi": 1e6, "n": 1.0}
    found = prior["kphi"].lower, prior["kphi"].upper
    assert found == pytest.approx((8e5 * 0.05 / 0.12, 1.25e6), rel=2e-3)
    assert "the gear is 0.12 m wide and the plate 0.05 m" in remark.text
    assert (remark.code, remark.about) == ("another-width", ("kphi",))
    wide = case(gear=Model(Wheel(radius=0.15, width=0.025)))
    found = plate_section(plates(), wide)[1]["kphi"]
    assert (found.lower, found.upper) == pytest.approx((8e5, 2.5e6), rel=2e-3)
    same = case(gear=Model(Wheel(radius=0.15, width=0.05)))
    assert plate_section(plates(), same)[2] == []


def test_plates_of_two_sizes_give_the_range_at_the_width_of_the_gear():
    _, prior, remarks = plate_section(plates((0.05, 0.1)), case())
    at_width = (0.05 / 0.12) ** 0.1
    expected = (8e5 * at_width, 1.25e6 * at_width)
    assert (prior["kphi"].lower, prior["kphi"].upper) == pytest.approx(expected, rel=2e-3)
    assert "kc" not in prior and remarks == []
    assert (prior["n"].lower, prior["n"].upper) == (0.9, 1.1)


@pytest.mark.parametrize(
    ("own", "used"),
    [
        (Prior(0.0, 3000.0), None),  # the file's
        (Prior(500.0, 3000.0), (500.0, 3000.0)),
        (Prior(0.0, 2500.0), (0.0, 2500.0)),
        (Prior(30.0, 2970.0), None),  # within a hundredth: the same
        (Prior(0.0, 4000.0), None),  # wider
        (Prior(-500.0, 2000.0), None),  # only one end lies in the file's
        (Prior(1000.0, 4000.0), None),
        (Prior(-30.0, 2000.0), (0.0, 2000.0)),  # within the slack, cut to the file's
        (Prior(1000.0, 3030.0), (1000.0, 3000.0)),
        (Prior(1.0, 2000.0, log=True), None),
    ],
)
def test_a_narrower_prior_is_used_where_it_lies_in_that_of_the_file(own, used):
    assert SAME_PRIOR == 0.02
    file = SimpleNamespace(
        names=("cohesion",), prior=SimpleNamespace(lower=[0.0], upper=[3000.0])
    )  # fmt: skip
    found = narrower_priors(file, SimpleNamespace(prior={"cohesion": own}))
    assert found == ({} if used is None else {"cohesion": used})
    assert narrower_priors(file, SimpleNamespace(prior={})) == {}
