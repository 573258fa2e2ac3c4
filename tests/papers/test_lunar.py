"""The example on lunar soil: information in readings, and the pull predicted from them."""

import sys
from pathlib import Path

import numpy as np
import pytest

from datagen.recipe import read_recipe
from soilml import Estimator, read_case
from soilml.cli import main

HERE = Path(__file__).parents[2] / "examples" / "papers"
sys.path.insert(0, str(HERE))

from lunar.exact import posterior  # noqa: E402
from lunar.predictions import (  # noqa: E402
    predict_from_estimate,
    predict_from_posterior,
    predict_from_prior,
    simulate_readings,
)
from lunar.pull import pull_interval, repeat_over_slips, sample_soils  # noqa: E402
from lunar.sweep import add_torque_noise, bounds, three_loads, wheel_forces  # noqa: E402

pytestmark = pytest.mark.slow

CASE = read_case(HERE / "lunar" / "model.toml")
LOWER, UPPER = bounds(CASE)
SPREAD = (UPPER - LOWER) / np.sqrt(12.0)
SLIPS = np.linspace(0.2, 0.6, 5)


@pytest.fixture(scope="module")
def estimator(tmp_path_factory):
    """The example's regressor with fewer centres, from fewer rows."""
    folder = tmp_path_factory.mktemp("lunar")
    data, spec, model = (str(folder / name) for name in ("d.parquet", "s.toml", "m.onnx"))
    text = (HERE / "lunar" / "spec.toml").read_text()
    Path(spec).write_text(text.replace("centres = 150", "centres = 50"))
    recipe = str(HERE / "lunar" / "recipe.toml")
    assert main(["generate", recipe, data, "--rows", "9000"]) == 0
    assert main(["train", spec, data, model]) == 0
    return Estimator.load(model)


@pytest.fixture(scope="module")
def truth():
    return LOWER + (UPPER - LOWER) * np.asarray([1.0, 2.0, 1.0]) / 3.0


def remaining_fraction(truth, slip, load, seed=1):
    """Remaining fraction of the prior width after readings, (3,)."""
    rng = np.random.default_rng(seed)
    torque = add_torque_noise(CASE, wheel_forces(CASE, truth, slip, load).torque, rng)
    return posterior(CASE, slip, torque, load, rng, 4000).std(axis=0) / SPREAD


def test_the_recipe_is_of_the_same_wheel_soil_prior_and_noise_as_the_model():
    assert read_recipe(HERE / "lunar" / "recipe.toml").case == CASE


def test_one_reading_hardly_narrows_any_parameter_alone(truth):
    assert (remaining_fraction(truth, np.asarray([0.4]), np.asarray([50.0])) > 0.6).all()


def test_slips_at_one_load_identify_the_shear_modulus_but_not_the_cohesion(truth):
    cohesion, _, modulus = remaining_fraction(truth, np.linspace(0.2, 0.6, 8), np.full(8, 50.0))
    assert modulus < 0.3
    assert cohesion > 0.8


def test_slips_at_three_loads_identify_all_three_parameters(truth):
    assert (remaining_fraction(truth, *three_loads()) < 0.3).all()


def test_soil_samples_follow_the_gaussian_inside_the_prior(truth):
    rng = np.random.default_rng(5)
    covariance = np.diag((0.02 * SPREAD) ** 2)
    draws = sample_soils(CASE, truth, covariance, rng, 4000)
    assert draws.mean(axis=0) == pytest.approx(truth, rel=0.01)
    assert draws.std(axis=0) == pytest.approx(0.02 * SPREAD, rel=0.05)
    cornered = sample_soils(CASE, UPPER, np.diag(SPREAD**2), rng, 500)
    assert ((cornered >= LOWER) & (cornered <= UPPER)).all()


def test_a_known_soil_gives_its_own_pull(truth):
    rng = np.random.default_rng(6)
    known = repeat_over_slips(truth, np.diag((1e-6 * SPREAD) ** 2), 5)
    pull, low, high = pull_interval(CASE, *known, SLIPS, 50.0, rng, 50)
    assert pull == pytest.approx(wheel_forces(CASE, truth, SLIPS, 50.0).drawbar_pull, rel=1e-4)
    assert (high - low < 1e-3).all()


def test_a_reading_predicts_the_pull_best_at_its_own_slip_and_the_prior_worst(estimator):
    rng = np.random.default_rng(7)
    seen = simulate_readings(CASE, SLIPS, 50.0, 80, rng)
    valid = estimator(slip=SLIPS, torque=seen.torque, load=50.0).in_range
    error = {}
    for name, at in (("own", SLIPS), ("mirrored", SLIPS[::-1])):
        pull = wheel_forces(CASE, seen.soils[:, None, :], at, 50.0).drawbar_pull
        error[name] = predict_from_estimate(CASE, estimator, seen, at, rng).error(pull, valid)
        error["prior"] = predict_from_prior(CASE, seen, at, rng).error(pull, valid)
    assert 2.0 * error["own"] < error["mirrored"] < 0.5 * error["prior"]


def test_the_machine_is_near_the_best_that_one_reading_allows(estimator):
    rng = np.random.default_rng(8)
    seen = simulate_readings(CASE, SLIPS, 50.0, 150, rng)
    best, mean = predict_from_posterior(CASE, seen, SLIPS, rng, 4096)
    values = seen.soils[:, None, :]
    found = estimator(slip=SLIPS, torque=seen.torque, load=50.0)
    assert found.in_range.mean() > 0.95
    least = np.sqrt(np.mean((mean - values) ** 2, axis=(0, 1)))
    own = np.sqrt(np.mean((found.mean - values) ** 2, axis=(0, 1)))
    assert (own < 1.06 * least).all()
    assert best.error(seen.pull) < 1.0
