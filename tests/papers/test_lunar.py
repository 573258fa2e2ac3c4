"""The example on lunar soil: information in readings, and the pull predicted from them."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from soilml import Estimator, read_case
from soilml.cli import main
from soilml.quantities import SHEAR

HERE = Path(__file__).parents[2] / "examples" / "papers"
sys.path.insert(0, str(HERE))

from lunar.exact import posterior  # noqa: E402
from lunar.predictions import (  # noqa: E402
    predict_from_estimate,
    predict_from_prior,
    predict_from_torque,
    simulate_readings,
)
from lunar.sweep import (  # noqa: E402
    add_torque_noise,
    bounds,
    soils,
    three_loads,
    wheel_forces,
)

pytestmark = pytest.mark.slow

CASE = read_case(HERE / "lunar" / "model.toml")
KNOWN = replace(CASE, prior={name: CASE.prior[name] for name in SHEAR})
LOWER, UPPER = bounds(CASE)
SPREAD = (UPPER - LOWER) / np.sqrt(12.0)
SLIPS = np.linspace(0.2, 0.6, 5)


@pytest.fixture(scope="module")
def estimator(tmp_path_factory):
    """The example's regressor alone, with fewer centres, from fewer rows."""
    folder = tmp_path_factory.mktemp("lunar")
    data, spec, model = (str(folder / name) for name in ("d.parquet", "s.toml", "m.onnx"))
    text = (HERE / "lunar" / "spec.toml").read_text().partition("[set_posterior]")[0]
    Path(spec).write_text(text.replace("centres = 150", "centres = 50"))
    recipe = str(HERE / "lunar" / "recipe.toml")
    assert main(["generate", recipe, data, "--rows", "9000"]) == 0
    assert main(["train", spec, data, model]) == 0
    return Estimator.load(model)


@pytest.fixture(scope="module")
def truth():
    return LOWER + (UPPER - LOWER) * np.asarray([1.0, 2.0, 1.0]) / 3.0


def remaining_fraction(truth, slip, load, case=CASE):
    """Remaining fraction of the prior width after readings, (3,)."""
    rng = np.random.default_rng(1)
    torque = add_torque_noise(case, wheel_forces(case, truth, slip, load).torque, rng)
    return posterior(case, slip, torque, load, rng, 4000)[:, :3].std(axis=0) / SPREAD


def test_slips_at_three_loads_identify_the_strength_and_with_the_bearing_all(truth):
    assert (remaining_fraction(truth, *three_loads(), KNOWN) < 0.3).all()
    cohesion, angle, modulus = remaining_fraction(truth, *three_loads())
    assert max(cohesion, angle) < 0.35
    assert modulus > 0.5


def test_the_pull_from_an_estimate_is_worse_than_from_the_torque_and_better_than_the_prior(
    estimator,
):
    rng = np.random.default_rng(7)
    seen = simulate_readings(CASE, SLIPS, 50.0, 80, rng)
    valid = estimator(slip=SLIPS, torque=seen.torque, load=50.0).in_range
    found = {
        "torque": predict_from_torque(CASE, seen, SLIPS, rng),
        "own": predict_from_estimate(CASE, estimator, seen, SLIPS, rng),
        "prior": predict_from_prior(CASE, seen, SLIPS, rng),
    }
    error = {name: one.error(seen.pull, valid) for name, one in found.items()}
    assert error["torque"] < error["own"] < 0.7 * error["prior"]


def test_intervals_hold_at_half_the_bearing_of_the_table(estimator):
    rng = np.random.default_rng(9)
    values = soils(CASE, 150, rng)
    values[:, 3] = 0.5 * CASE.soil.kphi
    force = wheel_forces(CASE, values[:, None], SLIPS, 50.0)
    found = estimator(slip=SLIPS, torque=add_torque_noise(CASE, force.torque, rng), load=50.0)
    inside = (found.low <= values[:, None, :3]) & (values[:, None, :3] <= found.high)
    assert (inside.mean(axis=(0, 1)) > 0.85).all()
