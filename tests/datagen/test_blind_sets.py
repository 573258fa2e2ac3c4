"""Hidden sets: a second wheel that agrees with the first, causes, designs, and what is written."""

import json
from collections import Counter
from dataclasses import fields, replace

import numpy as np
import pytest

from datagen.blind_sets import MECHANISMS, Plan, draw_blind_set, write_blind_set
from datagen.blind_sets.reading_errors import CHANNELS
from datagen.blind_sets.reference_wheel import (
    WheelState,
    ground_reaction,
    solve_equilibrium,
)
from datagen.blind_sets.run_schedules import DESIGNS, LOAD_JITTER
from datagen.blind_sets.soil_families import FAMILIES, FREE_PARAMETERS, RADIUS, WIDTH
from soilml import EFFECTS, Model, Operating, Soil, Wheel, read_table
from soilml.config.case import read_case
from soilml.physics.operating_point import COVARIATES, FROM_ORDER

PLAN = Plan("A", "slip-sinkage", 1.0, 0.01, 8, "dry-sand", 3, 7)


OF_SOILML = {**MECHANISMS["A"], **MECHANISMS["S"]}


CHANNEL_FIELDS = ("torque", "pull", "sinkage")


def batch(count, seed):
    """Rows all over the families, with every covariate varied."""
    rng = np.random.default_rng(seed)
    soils = [list(FAMILIES.values())[i % 3].soil(rng) for i in range(count)]
    return WheelState(
        slip=rng.uniform(0.05, 0.6, count),
        load=rng.uniform(40.0, 240.0, count),
        radius=np.full(count, RADIUS),
        width=np.full(count, WIDTH),
        speed=rng.uniform(0.01, 0.2, count),
        pass_number=rng.integers(1, 4, count).astype(float),
        slip_angle=rng.uniform(0.0, 0.3, count),
        elapsed=np.linspace(0.2, 1.0, count),
        **{name: np.array([s[name] for s in soils]) for name in soils[0]},
    )


def of_soilml(rows, effects=()):
    """Torque, drawbar pull and sinkage as the package has them, (3, n)."""
    soil = Soil(**{f.name: getattr(rows, f.name) for f in fields(Soil)})
    conditions = COVARIATES.keys() - FROM_ORDER.keys()
    at = Operating(**{f: getattr(rows, f) for f in ("slip", "load", *conditions)})
    force = Model(Wheel(radius=RADIUS, width=WIDTH), tuple(effects))(soil, at)
    return np.stack([force.torque, force.drawbar_pull, force.sinkage])


def of_hidden(rows, acting=()):
    push = solve_equilibrium(rows, acting)
    return np.stack([getattr(push, name) for name in CHANNEL_FIELDS])


def apart(one, other):
    """Largest difference of each channel, as a share of the channel's typical size."""
    typical = np.sqrt(np.mean(other**2, axis=1, keepdims=True))
    return np.abs((one - other) / np.maximum(typical, np.abs(other))).max(axis=1)


@pytest.mark.slow
@pytest.mark.parametrize("name", EFFECTS)
def test_a_cause_in_its_usual_form_is_the_packages_effect(name):
    if name not in OF_SOILML:
        pytest.skip("not hidden in any set")
    cause, cls, rows = OF_SOILML[name], EFFECTS[name], batch(60, seed=3)
    effect = cls(**{cls.about.size: cause.reference})
    ours, theirs = of_hidden(rows, ((cause, cause.reference),)), of_soilml(rows, [effect])
    assert np.isfinite(ours).all()
    assert apart(ours, theirs).max() < 1e-5
    assert apart(of_soilml(rows), theirs).max() > 1e-4  # it does act


def test_the_same_plan_gives_the_same_set_and_another_seed_another():
    one, again, other = (
        draw_blind_set(PLAN),
        draw_blind_set(PLAN),
        draw_blind_set(replace(PLAN, seed=8)),
    )
    assert one.truth == again.truth and one.model == again.model
    for name, values in one.columns.items():
        np.testing.assert_array_equal(values, again.columns[name])
    assert not np.array_equal(one.columns["torque_Nm"], other.columns["torque_Nm"])


def test_what_is_written_is_read_by_the_package_and_the_truth_lies_apart(tmp_path):
    given, kept = tmp_path / "given", tmp_path / "kept"
    write_blind_set(replace(PLAN, free=5), given, kept)
    assert sorted(p.name for p in given.iterdir()) == ["model.toml", "region.csv", "runs.csv"]
    case = read_case(given / "model.toml")
    assert tuple(case.prior) and set(case.prior) == set(FREE_PARAMETERS)
    assert set(case.noise) == set(CHANNELS)
    for name, prior in case.prior.items():
        assert prior.lower < getattr(case.soil, name) < prior.upper
    for name in ("runs.csv", "region.csv"):
        assert len(read_table(given / name, ("run", "slip", "load_N", *CHANNELS))) in (64, 24)
    truth = json.loads((kept / "truth.json").read_text())
    assert truth["causes"][0]["name"] == "slip-sinkage"
    assert truth["causes"][0]["parameters"]["n1"]["value"] == pytest.approx(0.4)
    assert "sinkage" not in (given / "model.toml").read_text().split("[noise]")[0]
    for name in FREE_PARAMETERS:
        assert getattr(case.soil, name) == pytest.approx(truth["soil"][name], rel=0.16)
        assert case.prior[name].lower < truth["soil"][name] < case.prior[name].upper
    with pytest.raises(ValueError, match="another folder"):
        write_blind_set(PLAN, given, given)


VALUES = {
    "slip": 0.3,
    "load": 80.0,
    "radius": 0.15,
    "width": 0.12,
    "cohesion": 800.0,
    "friction_angle": 0.55,
    "shear_modulus": 0.012,
    "kc": 990.0,
    "kphi": 1.2e6,
    "n": 1.0,
    "a0": 0.4,
    "a1": 0.15,
    "unit_weight": 15000.0,
    "speed": 0.05,
    "pass_number": 1.0,
    "slip_angle": 0.0,
}


def state(count=1, **changed):
    values = {name: np.full(count, v) for name, v in VALUES.items()}
    return WheelState(**(values | {name: np.asarray(v) for name, v in changed.items()}))


def test_the_shape_acts_on_both_halves_of_the_contact_with_its_largest_stress():
    """With n = 1 and the ellipse, the load of the normal stress is that of a direct sum."""
    rows = state(cohesion=[0.0], friction_angle=[0.0], kc=[0.0])
    cause = MECHANISMS["L"]["elliptic-pressure"]
    entry = np.array([0.5])
    load = ground_reaction(entry, rows, ((cause, 1.0),)).load[0]
    peak = (0.4 + 0.15 * 0.3) * 0.5
    theta = np.linspace(0.0, 0.5, 200_001)
    way = np.where(theta > peak, (0.5 - theta) / (0.5 - peak), theta / peak)
    largest = 1.2e6 * 0.15 * (np.cos(peak) - np.cos(0.5))
    normal = largest * np.sqrt(1.0 - (1.0 - way) ** 2)
    assert load == pytest.approx(
        0.15 * 0.12 * np.trapezoid(normal * np.cos(theta), theta), rel=1e-4
    )


@pytest.mark.slow
@pytest.mark.parametrize("design", DESIGNS)
def test_a_design_is_driven_as_it_says(design):
    runs = {"one-run": 1, "few-runs": 3, "few-rows": 1}.get(design, 8)
    for seed in range(2 if design == "missing-channels" else 1):
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
