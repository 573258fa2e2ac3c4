"""Plate and shear tests of the soil beside the runs of a wheel."""

from dataclasses import replace

import numpy as np
import pytest
from bevameter_tables import KC, KPHI, PHI, C, N, plates, shear
from gap_sets import case_of
from remarked import remarked

from soilml import Model, Operating, Table, Wheel, soil
from soilml.config.measurement_noise import Noise
from soilml.fitting.coordinates import select_free
from soilml.fitting.least_squares import SoilTestTerms
from soilml.gap import audit, gap
from soilml.identification.bevameter import bevameter
from soilml.identification.bevameter.soil_section import updated_soil
from soilml.numerics.prior import Prior
from soilml.physics.effects import EFFECTS
from soilml.physics.soils.soil_tests import PlatePressure, ShearStrength
from soilml.remarks import texts

pytestmark = pytest.mark.slow

SAND = soil("wong1989/dry_sand")
KNOWN = {name: getattr(SAND, name) for name in ("kc", "kphi", "n", "cohesion", "friction_angle")}
CASE = replace(
    case_of(),
    prior=case_of().prior | {"kphi": Prior(1e5, 1e7, log=True)},
    noise={"torque_Nm": Noise(share=0.02), "sinkage_m": Noise(share=0.03)},
)
SLIP, LOAD = np.tile(np.linspace(0.05, 0.6, 7), 3), np.repeat([40.0, 70.0, 120.0], 7)


def sand_tests():
    """A plate test and a shear test that agree with the sand."""
    plate = PlatePressure(plate_width=0.05, sinkage=0.02, pressure=1.0, scatter=0.1)
    shear = ShearStrength(normal_stress=7500.0, strength=1.0, scatter=0.05)
    return (
        replace(plate, pressure=float(plate.predicted(KNOWN))),
        replace(shear, strength=float(shear.predicted(KNOWN))),
    )


def runs(effects=(), seed=1):
    force = Model(CASE.model.gear, effects)(SAND, Operating(slip=SLIP, load=LOAD))
    z = np.random.default_rng(seed).standard_normal((2, SLIP.size))
    return Table(
        {
            "run": np.repeat(["a", "b", "c"], 7),
            "slip": SLIP,
            "load_N": LOAD,
            "torque_Nm": force.torque * (1.0 + 0.02 * z[0]),
            "sinkage_m": force.sinkage * (1.0 + 0.03 * z[1]),
        }
    )


@pytest.fixture(scope="module")
def reports():
    rows = runs((EFFECTS["slip-sinkage"](n1=0.3),))
    return [gap(replace(CASE, soil_tests=t), rows) for t in ((), sand_tests())]


def test_tests_of_the_soil_add_to_the_odds_of_the_cause(reports):
    alone, both = reports
    assert both.status == "named"
    assert both.cause_set == (("slip-sinkage",),)
    assert both.effects[0].log_odds > alone.suspects[0].log_odds + 1.0
    # the tests move soil and scatter too, on which the std depends: here it is 5 % larger
    assert both.soil_after["cohesion"].std < 1.1 * alone.soil_after["cohesion"].std


def test_the_model_keeps_its_tests(reports):
    assert reports[1].model.soil_tests == sand_tests()


def test_runs_that_agree_with_the_tests_have_no_gap():
    report = gap(replace(CASE, soil_tests=sand_tests()), runs())
    assert report.status == "no-gap"


def test_runs_on_another_soil_than_that_of_the_tests_are_remarked_on():
    _, shear = sand_tests()
    other = replace(shear, strength=2.0 * shear.strength)
    report = gap(replace(CASE, soil_tests=(other,)), runs())
    assert any("disagree with a test of the soil" in note for note in texts(report.notes))


def test_audit_knows_that_tests_hold_the_soil():
    design = runs()
    absorbed = [
        {e.name: e.absorbed for e in audit(replace(CASE, soil_tests=t), design).effects}
        for t in ((), sand_tests())
    ]
    assert absorbed[0].keys() == absorbed[1].keys()
    assert all(absorbed[1][name] <= absorbed[0][name] + 1e-9 for name in absorbed[0])
    assert min(absorbed[1][name] - absorbed[0][name] for name in absorbed[0]) < -0.05


def test_terms_of_a_fit_are_derivatives_of_deviations():
    case = replace(CASE, soil_tests=sand_tests())
    coordinates = select_free(case, None)
    terms, x = SoilTestTerms(case, coordinates), np.asarray([0.4, 0.5, 0.3, 0.6])
    steps = 1e-6 * np.eye(4)
    expected = (terms.deviation(x + steps) - terms.deviation(x - steps)).T / 2e-6
    np.testing.assert_allclose(terms.rates(x), expected, rtol=1e-5, atol=1e-7)
    assert SoilTestTerms().deviation(x).shape == (0,)


def test_bevameter_hands_its_tests_on():
    known = {"kc": KC, "kphi": KPHI, "n": N, "cohesion": C, "friction_angle": PHI}
    earlier = ShearStrength(normal_stress=1e3, strength=1e3, scatter=0.1)
    result = bevameter(plates(repeats=1), shear(repeats=1), CASE)
    case = updated_soil(replace(CASE, soil_tests=(earlier,)), result)
    plate, shear_test = case.soil_tests
    assert plate.plate_width == CASE.model.gear.width
    assert abs(float(plate.deviation(known))) < 0.05
    assert abs(float(shear_test.deviation(known))) < 0.05
    assert shear_test.normal_stress == pytest.approx(35e3 / 3.0, rel=1e-5)
    assert plate.scatter >= 0.15  # the usual scatter of repeats
    assert result.as_json()["tests"][1]["strength"] == shear_test.strength
    narrow = replace(CASE, model=Model(Wheel(radius=0.15, width=0.3)))
    one_size = plates(sizes=(0.05,))
    assert bevameter(one_size, None, narrow).tests == ()


def test_runs_that_agree_are_no_gap_only_where_the_tests_agree_too():
    plate, shear = sand_tests()
    known = {name: prior for name, prior in CASE.prior.items() if name != "kphi"}
    case = replace(CASE, prior=known, soil_tests=(plate, shear))
    assert gap(case, runs()).status == "no-gap"
    firm = replace(plate, pressure=1.6 * plate.pressure)  # no unknown parameter can explain it
    report = gap(replace(case, soil_tests=(firm, shear)), runs())
    assert report.status == "undecided"
    assert any("disagree with a test of the soil" in reason for reason in texts(report.reasons))
    assert not remarked(report.notes, "part of the gap")
