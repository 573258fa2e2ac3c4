"""Blind sets with a smooth discrepancy and other designs: as large, and as driven, as they say."""

import tomllib
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from datagen.blind_sets import Plan, benchmark_plans, draw_blind_set, write_blind_set
from datagen.blind_sets.plans import DISCREPANCIES, active_mechanisms
from datagen.blind_sets.reading_errors import CHANNELS, sensors
from datagen.blind_sets.reference_wheel import WheelState, solve_equilibrium
from datagen.blind_sets.run_schedules import DESIGNS, LOAD_JITTER
from datagen.blind_sets.soil_families import FAMILIES, RADIUS, WIDTH
from soilml import read_table
from soilml.config.case import read_case

PLAN = Plan("A", "slip-sinkage", 1.0, 0.01, 8, "dry-sand", 3, 7)
#: The first readings of plans without discrepancy, from before there was one.
FORMER = {
    ("A", "slip-sinkage", 1.0, 7): (0.46883493245869345, -3.8537072267312076, 0.009279735177246283),
    ("B", "slip-sinkage/lyasko", 1.0, 2): (
        3.029965319335324,
        -9.384940314900899,
        0.03230513244144116,
    ),
    ("N3", "", 0.0, 11): (3.5203508523319984, 2.0492434574490384, 0.016056648078935126),
}


def rows_at(slips, load=80.0):
    """The state of a wheel on dry sand at these slips."""
    soil = FAMILIES["dry-sand"].soil(np.random.default_rng(0))
    values = {"radius": RADIUS, "width": WIDTH, "load": load, "speed": 0.05, **soil}
    values |= {"pass_number": 1.0, "slip_angle": 0.0}
    return WheelState(slip=slips, **{k: np.full(slips.size, v) for k, v in values.items()})


@pytest.mark.slow
@pytest.mark.parametrize(("key", "readings"), FORMER.items())
def test_plans_without_discrepancy_give_the_sets_they_gave(key, readings):
    tier, cause, size, seed = key
    drawn = draw_blind_set(Plan(tier, cause, size, 0.01, 8, "dry-sand", 3, seed))
    for name, first in zip(CHANNELS, readings, strict=True):
        assert drawn.columns[name][0] == pytest.approx(first, rel=1e-12)
    assert not np.any(list(drawn.truth["discrepancy"]["runs"].values()))


@pytest.mark.slow
@pytest.mark.parametrize("rms", DISCREPANCIES[1:])
def test_the_discrepancy_has_the_rms_that_is_stated_in_every_channel(rms):
    drawn = draw_blind_set(replace(PLAN, discrepancy=rms))
    plain = draw_blind_set(PLAN)
    for name in CHANNELS:
        extra = np.array(drawn.truth["discrepancy"]["runs"][name])
        without = np.array(plain.truth["runs_true"][name])
        np.testing.assert_allclose(np.array(drawn.truth["runs_true"][name]) - extra, without)
        largest = np.abs(without).max()
        assert np.sqrt(np.mean(extra**2)) == pytest.approx(rms * largest, rel=1e-9)
        region = np.array(drawn.truth["discrepancy"]["region"][name])
        steady = np.array(plain.truth["region_true"][name])
        np.testing.assert_allclose(np.array(drawn.truth["region_true"][name]), steady + region)
        assert 0.0 < np.abs(region).max() < 4.01 * rms * largest


@pytest.mark.slow
def test_the_discrepancy_is_smooth_common_to_all_runs_and_independent_per_channel():
    found = []
    for seed in range(6):
        plan = Plan("D", "", 0.0, 0.01, 4, "loam", 3, seed, discrepancy=0.02, design="repeats")
        drawn = draw_blind_set(plan)
        extra = np.array([drawn.truth["discrepancy"]["runs"][name] for name in CHANNELS])
        slip, load = drawn.columns["slip"], drawn.columns["load_N"]
        one = (load == load[0]) & (drawn.columns["run"] == drawn.columns["run"][0])
        order = np.argsort(slip[one])
        steps = np.diff(extra[:, one][:, order], axis=1) / np.diff(slip[one][order])
        rms = np.sqrt(np.mean(extra**2, axis=1, keepdims=True))
        assert np.abs(steps / rms).max() < 40.0  # at most a few times the rms in 0.1 of slip
        for name in np.unique(drawn.columns["run"])[1:]:
            same = (drawn.columns["run"] == name) & (load == load[0])
            if same.any():
                np.testing.assert_array_equal(extra[:, same], extra[:, one])
        found.append(np.corrcoef(extra)[np.triu_indices(3, 1)])
    assert abs(np.mean(found)) < 0.3


@pytest.mark.slow
def test_noise_strays_about_the_true_readings_with_discrepancy():
    strays = []
    for seed in range(8):
        plan = Plan("D", "", 0.0, 0.02, 8, "loam", 3, seed, discrepancy=0.04)
        drawn, declared = draw_blind_set(plan), sensors(0.02)
        for name in CHANNELS:
            true = np.array(drawn.truth["runs_true"][name])
            strays.append((drawn.columns[name] - true) / declared[name].std(true))
    assert np.std(strays) == pytest.approx(1.0, abs=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("design", DESIGNS)
def test_a_design_is_driven_as_it_says(design):
    runs = {"one-run": 1, "few-runs": 3, "few-rows": 1}.get(design, 8)
    for seed in range(2):
        drawn = draw_blind_set(replace(PLAN, design=design, runs=runs, seed=seed))
        columns = drawn.columns
        load, run = columns["load_N"], columns["run"]
        levels, count = len(np.unique(load)), len(np.unique(run))
        assert drawn.truth["plan"]["design"] == design
        if design == "one-load":
            assert levels == 1 and count == 8
        if design == "one-run":
            assert levels == 1 and count == 1 and len(load) == 24
        if design == "few-rows":
            assert levels == 1 and count == 1 and 5 <= len(load) <= 10
            assert all(np.isfinite(columns[name]).all() for name in CHANNELS)
        if design == "torque-alone":
            assert np.isfinite(columns["torque_Nm"]).all()
            assert (
                np.isnan(columns["drawbar_pull_N"]).all() and np.isnan(columns["sinkage_m"]).all()
            )
        if design == "few-runs":
            assert levels == 3 and count == 3
        if design.startswith("jittered"):
            spread = np.std([np.log(load[run == r]) for r in np.unique(run)], axis=1)
            assert levels > 8
            assert 0.3 * LOAD_JITTER[0] < np.mean(spread) < 1.5 * LOAD_JITTER[1]
        if design == "jittered-one-load":
            assert np.std(np.log(load)) < 1.5 * LOAD_JITTER[1]
        if design == "repeats":
            points = Counter(zip(columns["slip"], load, strict=True))
            assert set(points.values()) in ({2}, {3})
            assert count == len(points) * next(iter(points.values())) // (len(load) // count)
        if design == "missing-channels":
            blank = [name for name in CHANNELS if np.isnan(columns[name]).all()]
            assert sorted(blank) == sorted(drawn.truth["missing"]) and len(blank) in (1, 2)
            kept = set(CHANNELS) - set(blank)
            assert all(np.isfinite(columns[name]).all() for name in kept)
        if design == "two-gears":
            assert Counter(columns["gear"]) == {"wheel_a": 32, "wheel_b": 32}
        if design == "braking":
            assert columns["slip"].min() < -0.2 and columns["slip"].max() > 0.4
            assert drawn.region["slip"].min() < -0.2
        assert load.max() * 1.29 < drawn.region["load_N"].min()


@pytest.mark.slow
def test_unequal_soils_scatter_three_times_as_much():
    scatter = [
        draw_blind_set(replace(PLAN, design="unequal-soils", runs=16, seed=i)).truth["scatter"]
        for i in range(6)
    ]
    phi = [s["runs"]["friction_angle_offset_rad"] for s in scatter]
    modulus = [np.log(s["runs"]["modulus_factor"]) for s in scatter]
    assert np.degrees(np.std(phi)) == pytest.approx(1.5, abs=0.3)
    assert np.std(modulus) == pytest.approx(0.15, abs=0.03)


def test_forces_are_continuous_through_zero_slip_and_a_towed_wheel_resists():
    near = solve_equilibrium(rows_at(np.array([-1e-6, 0.0, 1e-6])))
    for values in (near.torque, near.pull, near.sinkage):
        assert np.ptp(values) < 1e-4 * np.abs(values).max()
    wide = solve_equilibrium(rows_at(np.linspace(-0.4, 0.6, 11)))
    assert (np.diff(wide.torque) > 0.0).all() and (np.diff(wide.pull) > 0.0).all()
    assert wide.torque[0] < 0.0 and wide.pull[0] < 0.0 < wide.torque[-1]


def test_what_was_not_measured_is_blank_and_readable(tmp_path):
    plan = replace(PLAN, design="missing-channels")
    write_blind_set(plan, tmp_path / "given", tmp_path / "kept")
    table = read_table(tmp_path / "given" / "runs.csv", ("run", "slip", "load_N"))
    missing = draw_blind_set(plan).truth["missing"]
    assert all(np.isnan(table[name]).all() for name in missing)
    assert read_case(tmp_path / "given" / "model.toml").noise


def test_the_benchmark_is_spread_over_tiers_discrepancies_and_designs():
    plans = benchmark_plans()
    assert 850 < len(plans) < 920 and plans == benchmark_plans()
    assert len({plan.seed for plan in plans}) == len(plans)
    assert not {p.seed for p in plans} & {p.seed for p in benchmark_plans(1)}
    assert {plan.design for plan in plans} == set(DESIGNS)
    for tier in "ABCSM":
        own = [p for p in plans if p.tier == tier and p.design == "sweep"]
        shares = Counter(p.discrepancy for p in own)
        assert set(shares) == set(DISCREPANCIES) and len(set(shares.values())) == 1
        for field in ("noise", "size", "runs", "soil_family"):
            counts = Counter(getattr(p, field) for p in own)
            assert max(counts.values()) - min(counts.values()) <= 1
    for plan in plans:
        bare = plan.tier == "D" or plan.tier.startswith("N")
        assert (plan.size == 0.0) == bare == (plan.cause == "")
        assert (plan.tier != "D") or plan.discrepancy > 0.0
        if plan.design in ("one-run", "few-rows"):
            assert plan.runs == 1
            assert not any(m.needs for m in active_mechanisms(plan.tier, plan.cause))


def test_rows_between_are_of_the_same_runs_at_other_slips():
    drawn = draw_blind_set(replace(PLAN, tier="B", cause="slip-sinkage/square", seed=8, size=2.0))
    columns, between = drawn.columns, drawn.between
    assert drawn.truth["scatter"] and len(between["slip"]) == 24
    for name, slip, load in zip(between["run"], between["slip"], between["load_N"], strict=True):
        own = columns["run"] == name
        assert set(columns["load_N"][own]) == {load}
        assert columns["slip"][own].min() <= slip <= columns["slip"][own].max()
        assert slip not in columns["slip"][own]
    for name in CHANNELS:
        true = np.array(drawn.truth["between_true"][name])
        near = np.argmin(np.abs(between["slip"][:, None] - columns["slip"]), axis=1)
        same = between["run"] == columns["run"][near]  # the nearest slip, of the same soil
        assert same.any()
        there = np.array(drawn.truth["runs_true"][name])[near]
        gap = np.abs(between["slip"] - columns["slip"][near])
        steepest = np.ptp(drawn.truth["runs_true"][name]) / 0.05
        assert (np.abs(true - there)[same] <= steepest * gap[same] + 1e-12).all()


def test_two_gears_are_driven_at_the_same_points_on_one_soil():
    drawn = draw_blind_set(replace(PLAN, design="two-gears"))
    columns, first = drawn.columns, drawn.columns["gear"] == "wheel_a"
    assert first.sum() == (~first).sum() == 32 and len(np.unique(columns["run"])) == 8
    np.testing.assert_array_equal(columns["load_N"][first], columns["load_N"][~first])
    np.testing.assert_array_equal(columns["slip"][first], columns["slip"][~first])
    gears = tomllib.loads(drawn.model)["gears"]
    assert gears["wheel_b"]["radius"] < gears["wheel_a"]["radius"] == RADIUS
    assert gears["wheel_b"]["width"] < gears["wheel_a"]["width"] == WIDTH
    true = np.array(drawn.truth["runs_without"]["sinkage_m"])
    assert (true[~first] > true[first]).all()  # a smaller and narrower wheel sinks deeper
    assert set(drawn.region["gear"]) == {"wheel_a", "wheel_b"}


def test_grousers_are_on_one_of_two_wheels_that_are_alike():
    drawn = draw_blind_set(replace(PLAN, cause="grousers", design="two-gears"))
    gears = tomllib.loads(drawn.model)["gears"]
    assert gears["wheel_a"] == gears["wheel_b"]
    assert [cause["name"] for cause in drawn.truth["causes"]] == ["grousers@wheel_b"]
    lugged = drawn.columns["gear"] == "wheel_b"
    for name in CHANNELS:
        change = np.array(drawn.truth["runs_true"][name]) - drawn.truth["runs_without"][name]
        assert not change[~lugged].any() and change[lugged].all()
