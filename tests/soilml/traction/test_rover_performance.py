"""A rover on slopes: the balance of forces, ruts, gears of its own, gravity, and known soils."""

from dataclasses import replace

import numpy as np
import pytest
from measured_rows import torque_rows
from remarked import remarked

from soilml import Operating, read_case
from soilml.config.measurement_noise import Discrepancy
from soilml.config.remainder import Remainder, RemainderPart
from soilml.config.wheeled_rover import RoverWheel, WheeledRover
from soilml.physics.effects import EFFECTS
from soilml.traction import DrivenVehicle, performance, pull_report
from soilml.traction.draws import SoilDraws
from soilml.traction.prediction import MeasuredRange, predicted

NAMES = ("cohesion", "friction_angle", "shear_modulus")
SOIL = np.asarray([900.0, 0.6, 0.012])
FOUR = {
    "front-left": RoverWheel(0.4, 0.3),
    "front-right": RoverWheel(0.4, -0.3),
    "rear-left": RoverWheel(-0.4, 0.3),
    "rear-right": RoverWheel(-0.4, -0.3),
}
SLIP = np.linspace(0.025, 0.6, 24)
SLOPES = np.deg2rad([0.0, 6.0, 12.0])


@pytest.fixture
def case(model_file):
    return replace(read_case(model_file), rover=WheeledRover(28.0, (0.05, 0.0, 0.3), FOUR))


def draws(*soils):
    return SoilDraws(NAMES, np.asarray(soils or [SOIL]))


def total_pull(case, slip, slope, number=(1, 1, 2, 2)):
    """Pull of all wheels, each solved for itself, N."""
    true = case.with_values(dict(zip(NAMES, SOIL, strict=True)))
    at = Operating(slip=slip, load=case.rover.loads(slope), pass_number=np.asarray(number, float))
    return float(true.model(true.soil, at).drawbar_pull.sum())


def test_at_the_needed_slip_the_wheels_pull_the_weight_along_the_slope(case):
    found = performance(DrivenVehicle.of_rover(case), draws(), SLOPES, SLIP)
    for slope, slip in zip(SLOPES, found.slip[0], strict=True):
        weight = case.rover.weight * np.sin(slope)
        assert total_pull(case, slip, slope) == pytest.approx(weight, abs=0.005 * case.rover.weight)
    assert np.all(np.diff(found.slip[0]) > 0.0)
    assert np.all(np.diff(found.energy[0]) > 0.0)


def test_the_steepest_slope_takes_all_the_pull_there_is(case):
    found = performance(DrivenVehicle.of_rover(case), draws(), SLOPES, SLIP)
    slope = float(found.steepest_slope[0])
    pull = max(total_pull(case, slip, slope) for slip in SLIP)
    assert pull == pytest.approx(case.rover.weight * np.sin(slope), rel=1e-6)
    beyond = performance(DrivenVehicle.of_rover(case), draws(), np.asarray([slope * 1.01]), SLIP)
    assert beyond.climbed[0] == 0.0 and np.isnan(beyond.slip[0, 0]) and beyond.margin[0, 0] < 0.0


def test_loads_on_slopes_that_no_row_had_are_said(case):
    measured, found = MeasuredRange((0.0, 0.6), (65.0, 80.0)), {}
    for degrees in (0.0, 25.0):
        slopes = np.deg2rad([degrees])
        vehicle = DrivenVehicle.of_rover(case)
        found[degrees] = predicted(vehicle, draws(), draws(), slopes, SLIP, measured).warnings
    assert remarked(found[25.0], "no load below 65 N was measured")
    assert not remarked(found[0.0], "no load")


def passes(case):
    """Pass of each wheel of a rover."""
    wheels = DrivenVehicle.of_rover(case).wheels
    return {name: others["pass_number"] for name, (_, others) in wheels.items()}


def test_wheels_in_a_rut_are_those_of_the_second_pass(case):
    again = replace(case, model=case.model + EFFECTS["multipass"]())
    assert passes(again) == {name: 1 + name.startswith("rear") for name in FOUR}
    apart = {k: replace(w, left=2.0 * w.left) if "rear" in k else w for k, w in FOUR.items()}
    beside = replace(again, rover=replace(case.rover, wheels=apart))
    assert set(passes(beside).values()) == {1}


def measured(case, wheels):
    slip, load = np.linspace(0.1, 0.5, len(wheels)), case.rover.loads(0.0)[: len(wheels)]
    rows = torque_rows(case, dict(zip(NAMES, SOIL, strict=True)), slip, load)
    rows.columns["wheel"] = np.asarray(wheels)
    return rows


@pytest.mark.slow
def test_bands_of_a_rover_have_the_error_of_its_model(case):
    """At needed slip the torque has the declared error, whether declared or learned."""
    table = measured(case, list(FOUR))
    plain = pull_report(case, table, slopes=SLOPES, exact_model=True)
    part = RemainderPart(
        "torque_Nm", 0.2, 0.3, 0.3, 0.6, (0.1, 0.5), (20.0, 20.1),
        ((0.3, 20.0),), (0.0,), ((0.0,),), ((0.0,),),
    )  # fmt: skip
    learned = replace(case, remainder=Remainder((part,)))
    declared = replace(case, discrepancy={"torque_Nm": Discrepancy(constant=0.3)})
    for wide in (learned, declared):
        found = pull_report(wide, table, slopes=SLOPES, exact_model=True)
        assert not remarked(found.warnings, "not errors of the model")
        assert remarked(found.warnings, "errors of the model (torque")
        torque, exact = (f.by_load[0].posterior.torque["front-left"][:, 0] for f in (found, plain))
        # the wheel carries 68.7 N, two lengths beyond the learned range: a usual error, 0.3 N m
        assert np.std(torque) == pytest.approx(np.hypot(0.3, np.std(exact)), rel=0.15)
    assert remarked(plain.warnings, "not errors of the model")
