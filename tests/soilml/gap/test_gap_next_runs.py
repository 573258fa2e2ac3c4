"""Next runs: each kind by its own physics, rows that a rig can drive, and their costs."""

from dataclasses import replace

import numpy as np
import pytest
from gap_sets import candidate, case_of, driven, fit_problem

from soilml.errors import InputError
from soilml.gap.design.discriminating_runs import next_runs
from soilml.gap.design.run_kinds import KINDS, LISTED, check_costs, rank_by_cost
from soilml.gap.design.run_options import drivable_slips, gear_changes, run_options
from soilml.gap.report.results import NextRun
from soilml.physics.effects import EFFECTS
from soilml.physics.operating_point import Operating

pytestmark = pytest.mark.slow


def explained(effect, names, seed=2, **how):
    """A problem on rows with an effect, and the fits of several candidates."""
    case = case_of()
    problem = fit_problem(case, driven(case, [effect], seed=seed, **how))
    start = problem.fit_soil([np.full(3, 0.5)]).start_values()
    return problem, [candidate(problem, [name], start) for name in names]


@pytest.fixture(scope="module")
def slope_or_bulldozing():
    return explained(EFFECTS["bulldozing"](share=0.3), ("bulldozing", "slope"))


@pytest.fixture(scope="module")
def lugs_or_sensor():
    return explained(EFFECTS["torque-gain"](gain=0.05), ("torque-gain", "grousers"))


def test_reverse_tells_a_slope_from_bulldozing_by_its_own_physics(slope_or_bulldozing):
    found = {run.kind: run for run in next_runs(*slope_or_bulldozing)}
    assert found["reverse"].discrimination > 3.0
    assert {run.compared for run in found.values()} == {(("bulldozing",), ("slope",))}
    row = found["reverse"].rows[-1]
    assert row["speed_m_s"] == -0.05
    slope = slope_or_bulldozing[1][1]
    case = slope.fit.fitted()
    force = case.model(case.soil, Operating(slip=row["slip"], load=row["load_N"], speed=-0.05))
    assert row["drawbar_pull_N if slope"] == pytest.approx(float(force.drawbar_pull))


def test_a_run_that_no_explanation_tells_from_a_repeat_is_left_out(slope_or_bulldozing):
    kinds = {run.kind for run in next_runs(*slope_or_bulldozing)}
    assert not kinds & {"other speed", "second pass", "slip angle"}


def test_reverse_is_left_out_where_nothing_depends_on_the_direction(lugs_or_sensor):
    assert "reverse" not in {run.kind for run in next_runs(*lugs_or_sensor)}


def test_no_two_proposals_have_the_same_rows(slope_or_bulldozing, lugs_or_sensor):
    for rivals in (slope_or_bulldozing, lugs_or_sensor):
        rows = [tuple(tuple(row.items()) for row in run.rows) for run in next_runs(*rivals)]
        driven_rows = [r for r in rows if r]
        assert len(set(driven_rows)) == len(driven_rows)


def test_a_smooth_gear_tells_lugs_from_a_sensor(lugs_or_sensor):
    found = {run.kind: run for run in next_runs(*lugs_or_sensor)}
    smooth = found["smooth gear"]
    assert smooth.discrimination > 3.0
    row = smooth.rows[0]
    assert row["grouser_height_m"] == 0.0
    problem, (_, lugs) = lugs_or_sensor
    case = replace(problem.case, soil=lugs.fit.fitted().soil)  # without the lugs
    force = case.model(case.soil, Operating(slip=row["slip"], load=row["load_N"]))
    assert row["torque_Nm if grousers"] == pytest.approx(float(force.torque))


def test_the_gear_is_changed_only_where_an_effect_depends_on_it():
    case = case_of()
    assert list(gear_changes(case, [EFFECTS["slope"], EFFECTS["torque-gain"]])) == []
    kinds = {c.kind: c for c in gear_changes(case, list(EFFECTS.values()))}
    assert set(kinds) == {"smooth gear", "narrower gear", "larger wheel"}
    half = kinds["narrower gear"].apply(case).model.gear.width
    assert half == pytest.approx(0.5 * case.model.gear.width, rel=0.02)


def test_a_shear_test_is_proposed_where_the_soils_of_explanations_differ():
    rivals = explained(EFFECTS["bulldozing"](share=1.0), ("bulldozing", "drawbar-gain"))
    found = {run.kind: run for run in next_runs(*rivals)}
    (row,) = found["shear test"].rows
    values = rivals[1][0].fit.values()
    assert row["friction_angle_rad if bulldozing"] == pytest.approx(values["friction_angle"])
    sensors = explained(EFFECTS["torque-gain"](gain=0.05), ("torque-gain", "torque-offset"))
    assert "shear test" not in {run.kind for run in next_runs(*sensors)}


def test_rows_are_ones_that_a_rig_can_drive():
    case = case_of()
    loads = (13.37, 21.04, 30.9)
    readings = fit_problem(case, driven(case, loads=loads)).readings
    for option in run_options(readings, case, list(EFFECTS.values())):
        load, slip = np.asarray(option.at.load), np.asarray(option.at.slip)
        np.testing.assert_array_equal(load, np.round(load))
        np.testing.assert_allclose(slip, np.round(slip, 2), atol=1e-12)
        assert load.max() <= 2.0 * max(loads) and slip.max() <= 0.8 and slip.size >= 3
        changed = option.changed(case)
        at = replace(option.at, speed=0.05, pass_number=1.0, slip_angle=0.0)
        assert (changed.model(changed.soil, at).status == 0).all()


def test_a_run_at_higher_slips_begins_where_the_driven_ones_end():
    case = case_of()
    readings = fit_problem(case, driven(case, slips=6)).readings  # slips up to 0.6
    options = {o.kind: o for o in run_options(readings, case, list(EFFECTS.values()))}
    higher = options["higher slip"]
    assert higher.at.slip.min() == pytest.approx(0.6, abs=0.03)
    assert higher.at.slip.max() == pytest.approx(0.8)
    assert higher.text.startswith("slips up to 0.8 under ")


def test_a_load_that_the_soil_does_not_carry_is_lowered_or_left_out():
    case = case_of()
    soft = case.with_values({"kc": 0.0, "kphi": 5e4})
    readings = fit_problem(case, driven(case, loads=(30.0, 40.0))).readings
    options = {option.kind: option for option in run_options(readings, soft, [])}
    for option in options.values():
        assert (soft.model(soft.soil, option.at).status == 0).all()


def test_loads_of_a_tiny_wheel_have_two_digits():
    case = case_of()
    readings = fit_problem(case, driven(case, loads=(2.34, 3.21))).readings
    loads = {float(option.at.load[0]) for option in run_options(readings, case, [])}
    assert all(load == round(load, 1) for load in loads)


@pytest.mark.parametrize("low, high", [(0.05, 0.6), (0.013, 0.117), (-0.4, -0.05), (0.2, 0.95)])
def test_slips_are_round_and_spread_over_the_range(low, high):
    slips = drivable_slips(low, high)
    assert 3 <= slips.size <= 8 and np.all(np.diff(slips) > 0.0)
    np.testing.assert_allclose(slips * 100.0, np.round(slips * 100.0), atol=1e-9)
    assert slips[0] == pytest.approx(low, abs=0.026)
    assert slips[-1] == pytest.approx(min(high, 0.8), abs=0.026)


def run(kind, sigma):
    return NextRun(kind, kind, sigma, ())


def test_costs_rank_by_what_is_discriminated_per_cost():
    runs = [run("heavier", 6.0), run("reverse", 4.0), run("smooth gear", 9.0)]
    assert [r.kind for r in rank_by_cost(runs, {})] == ["smooth gear", "heavier", "reverse"]
    assert all(r.cost is None for r in rank_by_cost(runs, {}))
    priced = rank_by_cost(runs, check_costs({"smooth-gear": 5.0, "heavier": 2.0}))
    assert [(r.kind, r.cost) for r in priced] == [
        ("reverse", 1.0),
        ("heavier", 2.0),
        ("smooth gear", 5.0),
    ]
    assert len(rank_by_cost(runs * 9, {})) == LISTED


def test_every_kind_that_is_proposed_can_have_a_cost(slope_or_bulldozing, lugs_or_sensor):
    case = case_of()
    readings = slope_or_bulldozing[0].readings
    kinds = {option.kind for option in run_options(readings, case, list(EFFECTS.values()))}
    for rivals in (slope_or_bulldozing, lugs_or_sensor):
        kinds |= {r.kind for r in next_runs(*rivals)}
    assert kinds <= set(KINDS)


@pytest.mark.parametrize(
    "costs, said",
    [
        ({"revers": 2.0}, "cost of 'revers': no such kind of run; there are: heavier, lighter"),
        ({"reverse": 0.0}, "cost of 'reverse' is 0; needed is a number above zero"),
        ({"reverse": float("nan")}, "needed is a number above zero"),
    ],
)
def test_unknown_kinds_and_impossible_costs_are_refused(costs, said):
    with pytest.raises(InputError, match=said):
        check_costs(costs)
