"""How well runs and checks discriminate between explanations, evaluated by hand."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from gap_sets import case_of, driven, fit_problem

from soilml.errors import InputError
from soilml.fitting.coordinates import Coordinate
from soilml.fitting.effect_signatures import Signature
from soilml.gap.design import discriminating_runs as design
from soilml.gap.design.identifiability import _are_equal, identifiability, indistinguishable_classes
from soilml.gap.design.planned_readings import expected_readings, planned_readings
from soilml.gap.design.run_kinds import SENSOR_CHECKS, SOIL_TESTS
from soilml.gap.report.results import NextRun
from soilml.io.table import Table
from soilml.numerics.prior import Prior
from soilml.physics.effects import EFFECTS
from soilml.physics.operating_point import Operating


def soil_tests(rates, deviation=()):
    return SimpleNamespace(rates=lambda x: rates, deviation=lambda x: np.asarray(deviation))


def coordinate(std=np.inf, path="soil", rate=1.0):
    """A parameter of the soil."""
    return SimpleNamespace(std=std, path=path, rate=lambda x: rate * x, effect="", is_shape=False)


def rival(coordinates, x, tests=None, values=None):
    return SimpleNamespace(
        coordinates=coordinates,
        x=np.asarray(x, dtype=float),
        soil_tests=tests or soil_tests(np.zeros((0, len(x)))),
        values=lambda: values,
    )


def test_a_rival_adapts_its_parameters_against_their_priors():
    """One parameter, which moves the first of two readings; its prior pulls it back."""
    free = rival([coordinate()], [0.5])
    part = np.asarray([3.0, 4.0]), np.asarray([[2.0], [0.0]])
    assert design._adapted_misfit(free, [part]) == pytest.approx(16.0)
    # (3 - 2 d)^2 + (0.5 + d)^2 / 0.25 is least at d = 0.5
    bound = rival([coordinate(std=0.5)], [0.5])
    assert design._adapted_misfit(bound, [part]) == pytest.approx(16.0 + 4.0 + 4.0)


def test_tests_of_the_soil_hold_a_rival_back():
    """A test that is 2 sigma off, and a sigma more for each unit of the parameter."""
    held = rival([coordinate()], [0.0], soil_tests(np.asarray([[1.0]]), [2.0]))
    part = np.asarray([3.0, 4.0]), np.asarray([[2.0], [0.0]])
    # (3 - 2 d)^2 + (2 + d)^2 is least at d = 4 / 5
    assert design._adapted_misfit(held, [part]) == pytest.approx(16.0 + 1.4**2 + 2.8**2)


def test_discrimination_is_the_root_of_what_new_rows_add_to_the_misfit():
    free = rival([coordinate()], [0.0])
    present = np.asarray([1.0]), np.asarray([[1.0]])
    new = np.asarray([5.0]), np.asarray([[1.0]])
    # with both rows d is 3, and 2 is left in each
    assert design._discrimination(free, present, new) == pytest.approx(np.sqrt(8.0))
    assert design._discrimination(free, present, present) == pytest.approx(0.0, abs=1e-9)
    # two rows leave 2 already; with a third like the second d is 7 / 3, and 8 / 3 is left
    two = np.asarray([1.0, 3.0]), np.ones((2, 1))
    third = np.asarray([3.0]), np.ones((1, 1))
    assert design._discrimination(free, two, third) == pytest.approx(np.sqrt(2.0 / 3.0))
    unsolved = np.asarray([np.nan]), np.asarray([[1.0]])
    assert np.isnan(design._discrimination(free, present, unsolved))
    unsolved = np.asarray([1.0]), np.asarray([[np.inf]])
    assert np.isnan(design._adapted_misfit(free, [unsolved]))


def test_discriminations_are_capped_at_ten_sigma_before_their_mean():
    assert design._mean_capped([4.0, 9.9, 25.0]) == pytest.approx((4.0 + 9.9 + 10.0) / 3.0)


def size(effect, path, is_shape=False):
    prior = Prior(0.0, 1.0)
    return Coordinate(f"{effect}.{path}", "1", prior, lower=-9.0, upper=9.0, is_shape=is_shape)


def test_a_check_of_the_sensors_rejects_an_error_by_its_size_after_the_check():
    gain = rival([size("torque-gain", "gain")], [0.0], values={"torque-gain.gain": -0.06})
    offset = rival(
        [size("torque-offset", "offset"), size("torque-gain", "by_slip", is_shape=True)],
        [0.0, 0.0],
        values={"torque-offset.offset": 0.2, "torque-gain.by_slip": 99.0},
    )
    after = {"torque-gain": 0.02, "torque-offset": 0.05}
    assert design._check_discrimination(gain, offset, after) == pytest.approx(4.0)
    assert design._check_discrimination(offset, gain, {"torque-gain": 0.02}) == pytest.approx(3.0)
    assert design._check_discrimination(offset, offset, {"slip-offset": 0.02}) == 0.0


def test_a_test_of_the_soil_compares_what_it_determines():
    first = rival([], [], values={"cohesion": 500.0, "friction_angle": 0.5})
    names = ("kphi", "friction_angle", "cohesion")
    other = rival(
        [coordinate(path=name, rate=10.0) for name in names],
        [0.1, 0.2, 0.3],
        values={"cohesion": 800.0, "friction_angle": 0.6},
    )
    after = {"cohesion": (0.2, True), "friction_angle": (0.05, False)}
    difference, jacobian = design._soil_difference(first, other, after)
    assert difference == pytest.approx([-300.0 / 100.0, -0.1 / 0.05])
    assert jacobian == pytest.approx(np.asarray([[0.0, 0.0, 3.0 / 100.0], [0.0, 2.0 / 0.05, 0.0]]))


def test_runs_with_equal_rows_are_listed_once_with_both_instructions():
    rows = ({"slip": 0.1},)
    runs = [
        NextRun("a", "drive slowly", 3.0, rows),
        NextRun("b", "drive fast", 3.0, ({"slip": 0.2},)),
        NextRun("c", "drive softly", 2.0, ({"slip": 0.1},)),
        NextRun("check", "read the sensor", 1.0, ()),
        NextRun("check", "read it again", 1.0, ()),
    ]
    found = design._without_equal_rows(runs)
    assert [(r.kind, r.text) for r in found] == [
        ("a", "drive slowly; or drive softly"),
        ("b", "drive fast"),
        ("check", "read the sensor; or read it again"),
    ]


@pytest.mark.parametrize("apart, repeat", [(0.09, True), (0.11, False)])
def test_a_run_is_a_repeat_where_predictions_agree_to_a_tenth_of_a_sigma(apart, repeat):
    readings = SimpleNamespace(std=np.asarray([1.0, 2.0]))
    y = np.zeros((2, 2, 2))
    y[1, 1, 1] = -2.0 * apart
    assert design._is_plain_repeat(readings, y) == repeat
    assert not design._is_plain_repeat(readings, y[:1])


def test_columns_of_dropped_coordinates_are_zero():
    fit = SimpleNamespace(coordinates=[coordinate(path=p) for p in ("a", "b", "c")])
    changed = SimpleNamespace(coordinates=[coordinate(path=p) for p in ("a", "c")])
    given = np.asarray([7.0, 8.0]), np.asarray([[1.0, 2.0], [3.0, 4.0]])
    difference, jacobian = design._all_columns(fit, given, changed)
    assert difference is given[0]
    assert jacobian.tolist() == [[1.0, 0.0, 2.0], [3.0, 0.0, 4.0]]


def test_static_proposals_need_an_error_to_check_or_a_soil_to_test():
    def fit(values, coordinates):
        return rival(coordinates, [0.5] * len(coordinates), values=values)

    soils = [coordinate(path="cohesion", rate=1000.0)]
    fits = {
        "dig": fit({"cohesion": 500.0}, soils),
        "plough": fit({"cohesion": 900.0}, soils),
    }
    nothing = [(np.zeros(1), np.zeros((1, 1)))]
    assert design._static_proposals(fits, nothing, [EFFECTS["torque-gain"]]) == []
    found = design._static_proposals(fits, nothing, [EFFECTS["slip-sinkage"]])
    kinds = [kind for kind, (_, after) in SOIL_TESTS.items() if "cohesion" in after]
    assert [run.kind for run in found] == kinds and kinds
    (row,) = found[0].rows
    assert row == {"cohesion_Pa if dig": 500.0, "cohesion_Pa if plough": 900.0}
    gain = [size("torque-gain", "gain")]
    fits = {
        "one": fit({"torque-gain.gain": 0.05}, gain),
        "two": fit({"torque-gain.gain": 0.0}, gain),
    }
    found = design._static_proposals(fits, nothing, [])
    checks = [kind for kind, (_, std) in SENSOR_CHECKS.items() if "torque-gain" in std]
    assert [run.kind for run in found] == checks and checks
    assert found[0].discrimination == pytest.approx(
        min(0.05 / SENSOR_CHECKS[checks[0]][1]["torque-gain"], 10.0)
    )


@pytest.mark.parametrize("apart, equal", [(0.09, True), (-0.11, False)])
def test_signatures_are_equal_to_a_tenth_of_a_sigma(apart, equal):
    std = np.asarray([1.0, 2.0])
    usual = {"rate": np.asarray([5.0, 5.0])}
    new = {"rate": Signature("rate", "soil", np.asarray([5.0, 5.0 + 2.0 * apart]), 0)}
    assert _are_equal(usual, new, std) == equal
    assert not _are_equal(usual | {"slope": np.zeros(2)}, new, std)


def test_alone_an_effect_has_no_rival_and_equal_ones_no_separation():
    one = Signature("rate", "soil", np.asarray([3.0, 4.0, 0.0]), 0)
    same = Signature("slope", "rig", np.asarray([-6.0, -8.0, 0.0]), 0)
    std, soil = np.ones(3), np.asarray([[0.0], [0.0], [1.0]])
    (alone,) = identifiability([one], std, soil, EFFECTS)
    assert alone.rivals == () and alone.separating_snr == pytest.approx(5.0)
    first, _ = identifiability([one, same], std, soil, EFFECTS)
    assert first.rivals == (("slope", pytest.approx(1.0)),)
    assert first.separating_snr == pytest.approx(0.0, abs=1e-6)
    assert indistinguishable_classes([one, same], std, soil) == (("rate", "slope"),)


def test_expected_readings_have_the_noise_of_the_channel_or_its_typical_one():
    case = case_of()
    problem = fit_problem(case, driven(case))
    readings = problem.readings
    noise = (readings.noise[0], None, readings.noise[2])
    plain = case.noise.pop("drawbar_pull_N")
    like = replace(readings, noise=noise)
    at = Operating(slip=np.asarray([0.1, 0.3]), load=np.asarray([50.0, 80.0]))
    found = expected_readings(at, like, case)
    case.noise["drawbar_pull_N"] = plain
    force = case.model(case.soil, at)
    assert found.measured == pytest.approx([*force.torque, *force.drawbar_pull, *force.sinkage])
    typical = np.median(readings.std[readings.channel == 1])
    assert found.std == pytest.approx(
        [*(0.01 * np.abs(force.torque)), typical, typical, *(0.01 * np.abs(force.sinkage))]
    )
    assert found.runs == ("next",) and found.order.tolist() == [0, 1]
    assert found.run.tolist() == [0, 0] and found.channel.tolist() == [0, 0, 1, 1, 2, 2]


def test_a_planned_row_that_the_soil_cannot_carry_is_named():
    case = case_of()
    design_rows = Table(
        {"run": np.asarray(["b", "a"]), "slip": np.full(2, 0.2), "load_N": np.asarray([60.0, 1e7])}
    )
    with pytest.raises(InputError, match="row 2"):
        planned_readings(case, design_rows)
    good = Table({**design_rows.columns, "load_N": np.asarray([60.0, 70.0])})
    found = planned_readings(case, good)
    assert found.runs == ("a", "b") and found.run.tolist() == [1, 0]
    assert found.row.tolist() == [0, 1] * 3 and found.channel.tolist() == [0, 0, 1, 1, 2, 2]
    assert found.order.tolist() == [0, 1]
