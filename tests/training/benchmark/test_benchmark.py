"""The fixed benchmark: sets, Bayes limit, scores of methods, acceptance goals."""

import json
from pathlib import Path

import numpy as np
import pytest

from datagen.recipe import read_recipe
from soilml import Estimator
from soilml.quantities import SHEAR
from training.benchmark.bayes_limit import UNMODELLED_EFFECTS, benchmark_sets
from training.benchmark.bayes_limit_file import load_limit, packaged_limit
from training.benchmark.suite import (
    LIMIT_LABEL,
    POSTERIOR_LABEL,
    RECIPE,
    benchmark,
)

pytestmark = pytest.mark.slow

EXPORTED = Path(__file__).parents[3] / "exported"


@pytest.fixture(scope="module")
def recipe():
    return read_recipe(RECIPE)


@pytest.fixture(scope="module")
def results(recipe):
    sets = benchmark_sets(recipe, SHEAR, 12)
    limit = load_limit(packaged_limit(), sets)
    positions = {one.table["torque_Nm"].tobytes(): i for i, one in enumerate(sets)}

    def exact(slip, torque, load):
        i = positions[torque.tobytes()]
        return limit.mean[i], limit.covariance[i]

    def noisy(slip, torque, load):
        i = positions[torque.tobytes()]
        std = np.sqrt(np.diag(limit.covariance[i]))
        return limit.mean[i] + 0.8 * std * np.random.default_rng(i).normal(size=3), std

    def oracle(slip, torque, load):
        truth = sets[positions[torque.tobytes()]].truth
        return 1.0000001 * truth, 1e-6 * truth

    functions = {"exact": exact, "noisy": noisy, "oracle": oracle}
    return benchmark(functions=functions, max_sets=12, analytic=())


def select(results, method, effect=""):
    return [r for r in results if r.method == method and r.effect == effect]


def test_no_released_model_was_trained_on_the_benchmark(recipe):
    files = sorted(EXPORTED.glob("*.onnx"))
    seeds = [json.loads(Estimator.load(file).metadata["recipe"]).get("seed") for file in files]
    assert files and recipe.seed not in [*seeds, read_recipe("wheel_test").seed]


def test_the_limit_is_calibrated(recipe):
    every = [j for j in benchmark_sets(recipe, SHEAR) if not j.effect]
    stored = load_limit(packaged_limit(), every)
    truth = np.stack([j.truth for j in every])
    inside = (truth > stored.quantiles[:, 0]) & (truth < stored.quantiles[:, 3])
    np.testing.assert_allclose(inside.mean(axis=0), 0.9, atol=0.02)
    assert np.mean(stored.hpd_levels < 0.9) == pytest.approx(0.9, abs=0.02)
    assert np.mean(stored.flagged) < 0.01


def test_an_unmodelled_effect_raises_rmse_and_flags(results):
    for effect in UNMODELLED_EFFECTS:
        known, lacking = (
            select(results, LIMIT_LABEL)[-1],
            select(results, POSTERIOR_LABEL, effect)[-1],
        )
        assert known.design == lacking.design
        assert (lacking.rmse > 1.5 * known.rmse).all()
        assert lacking.flagged_fraction > known.flagged_fraction
