"""Hidden sets: a second wheel that agrees with the first, causes that act, sets that hide them."""

import json
from dataclasses import fields, replace

import numpy as np
import pytest

from datagen.blind_sets import MECHANISMS, Plan, draw_blind_set, write_blind_set
from datagen.blind_sets.reading_errors import CHANNELS
from datagen.blind_sets.reference_wheel import WheelState, solve_equilibrium
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
    cause, cls, rows = OF_SOILML[name], EFFECTS[name], batch(120, seed=3)
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
