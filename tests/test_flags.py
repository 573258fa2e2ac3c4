"""Which faults of a set the released wheel file flags, and which it cannot."""

from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binom

from datagen.recipe import read_recipe
from soilml import Estimator
from soilml.errors import InputError
from soilml.physics.operating_point import Operating
from soilml.quantities import SHEAR
from training.set_posterior.families.recipe_family import RecipeFamily

CASE = read_recipe("wheel").case
SLIP = np.tile([0.08, 0.14, 0.21, 0.29, 0.38, 0.48], 2)
LOAD = np.repeat([45.0, 90.0], 6)
CHANNELS = ("slip", "load", "torque", "sinkage", "drawbar_pull")
SETS = 12


@pytest.fixture(scope="module")
def wheel():
    return Estimator.load(Path(__file__).parents[1] / "exported" / "wheel.onnx")


def simulate(soil, seed=0, slip=SLIP, load=LOAD):
    """Noisy readings on a soil (cohesion, friction angle, shear modulus)."""
    case = CASE.with_values(dict(zip(SHEAR, soil, strict=True)))
    force = case.model(case.soil, Operating(slip=slip, load=load))
    rng = np.random.default_rng(seed)
    torque = force.torque * (1.0 + 0.02 * rng.standard_normal(len(slip)))
    sinkage = force.sinkage + 0.0005 * rng.standard_normal(len(slip))
    pull = force.drawbar_pull + np.hypot(0.5, 0.02 * force.drawbar_pull) * rng.standard_normal(
        len(slip)
    )
    return dict(zip(CHANNELS, (slip, load, torque, sinkage, pull), strict=True))


def soils(count, seed=1):
    rng = np.random.default_rng(seed)
    ranges = [CASE.prior[name] for name in SHEAR]
    return np.stack([prior.at(rng.random(count)) for prior in ranges], axis=1)


def torque_only(rows):
    return {name: rows[name] for name in ("slip", "load", "torque")}


def flagged(wheel, rows, width=0.35):
    """Whether the set is flagged or refused; a flagged estimate must be widened towards the prior.

    `width` is the least standard deviation of a flagged estimate, as a share of the prior's.
    """
    try:
        estimate = wheel.run(**rows)
    except InputError:
        return True
    if not estimate.in_range:
        assert np.all((wheel.prior.lower <= estimate.mean) & (estimate.mean <= wheel.prior.upper))
        assert np.all(estimate.std >= width * wheel.prior.std)
    return not bool(estimate.in_range)


@pytest.mark.parametrize(
    ("name", "factor"),
    [
        ("torque", 1e3),
        ("torque", 1e2),
        ("torque", 1e-3),
        ("torque", 1 / 9.81),
        ("load", 1 / 9.81),
        ("load", 1e3 / 9.81),
        ("load", 1e-3),
        ("slip", 100.0),
        ("sinkage", 1e3),
        ("sinkage", 1e2),
    ],
)
def test_a_wrong_unit_is_flagged(wheel, name, factor):
    for k, soil in enumerate(soils(SETS)):
        rows = simulate(soil, k)
        rows = rows if name == "sinkage" else torque_only(rows)
        assert flagged(wheel, rows | {name: factor * rows[name]}, width=0.75)


def test_rows_of_two_different_soils_are_flagged(wheel):
    weak, strong = simulate((200.0, 0.47, 0.02), 1), simulate((2500.0, 0.75, 0.01), 2)
    half = np.arange(len(SLIP)) % 2 == 0
    rows = {name: np.where(half, weak[name], strong[name]) for name in CHANNELS}
    assert flagged(wheel, torque_only(rows)) and flagged(wheel, rows)
    assert not flagged(wheel, weak) and not flagged(wheel, strong)


def test_one_outlier_is_flagged(wheel):
    for k, soil in enumerate(soils(SETS)):
        rows = torque_only(simulate(soil, k))
        rows["torque"][k] *= 2.0
        assert flagged(wheel, rows)


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_another_wheel_is_flagged_where_sinkage_and_pull_are_read(wheel, factor):
    other = CASE.with_values({"gear.radius": factor * CASE.model.gear.radius})
    for k, soil in enumerate(soils(SETS)):
        case = other.with_values(dict(zip(SHEAR, soil, strict=True)))
        force = case.model(case.soil, Operating(slip=SLIP, load=LOAD))
        rows = simulate(soil, k) | {
            name: getattr(force, name) for name in ("torque", "sinkage", "drawbar_pull")
        }
        assert flagged(wheel.on(model_error=0.0), rows)


@pytest.mark.slow
@pytest.mark.parametrize("rows", [1, 3, 6, 16])
def test_one_valid_set_in_a_hundred_is_flagged(wheel, rows):
    sets = RecipeFamily.of(read_recipe("wheel"), SHEAR).sets(300, rows, 991)
    count = 0
    for k in range(len(sets.truth)):
        given = sets.rows(k)
        for name in ("sinkage", "drawbar_pull"):
            given[name] = np.where(given[f"{name}_std"] < 1e3, given[name], np.nan)
        count += flagged(wheel, given)
    assert count <= binom.ppf(0.9995, len(sets.truth), 0.01)
