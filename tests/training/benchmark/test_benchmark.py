"""The fixed benchmark: sets, Bayes limit, scores of methods, acceptance goals."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from datagen.recipe import read_recipe
from soilml import Estimator
from soilml.errors import InputError
from soilml.identification import identify
from soilml.quantities import SHEAR
from training.benchmark.acceptance import goals
from training.benchmark.bayes_limit import UNMODELLED_EFFECTS, benchmark_sets, exact_posterior
from training.benchmark.bayes_limit_file import load_limit, packaged_limit, save_limit
from training.benchmark.designs import (
    select_channels,
)
from training.benchmark.methods import (
    MethodKind,
    gaussian_estimate,
)
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


def test_the_packaged_limit_is_the_exact_posterior(recipe):
    """Some sets again, by the model itself and not by its surrogate."""
    every = benchmark_sets(recipe, SHEAR)
    stored = load_limit(packaged_limit(), every)
    for i in np.flatnonzero([j.number == 7 and not j.effect for j in every])[[0, 1, 6, 9]]:
        one = every[i]
        fit = identify(
            recipe.case, select_channels(one.table, ["torque"]), list(SHEAR), "posterior"
        )
        np.testing.assert_allclose((stored.mean[i] - fit.values) / fit.std, 0.0, atol=0.12)
        std = np.sqrt(np.diag(stored.covariance[i]))
        np.testing.assert_allclose(std / fit.std, 1.0, atol=0.1)
        np.testing.assert_allclose((stored.quantiles[i, 0] - fit.low) / fit.std, 0.0, atol=0.25)
        np.testing.assert_allclose((stored.quantiles[i, 3] - fit.high) / fit.std, 0.0, atol=0.25)
        again = exact_posterior(recipe.case, one.table, one.truth, SHEAR)
        assert stored.log_densities[i] == pytest.approx(again.log_density, abs=0.1)


def test_the_log_density_at_the_truth_agrees_with_a_grid(recipe):
    """One row: likelihood at the truth over its mean on a grid over the prior."""
    from soilml.fitting.coordinates import select_free
    from soilml.fitting.predictions import predict_channels
    from soilml.fitting.usable_readings import usable_readings

    one = benchmark_sets(recipe, SHEAR, 1)[0]
    data = usable_readings(recipe.case, select_channels(one.table, ["torque"]))
    free = select_free(recipe.case, SHEAR)
    side = (np.arange(24) + 0.5) / 24
    u = np.stack(np.meshgrid(side, side, side), axis=-1).reshape(-1, 3)
    truth = [f.prior.fraction(t) for f, t in zip(free, one.truth, strict=True)]
    y = predict_channels(recipe.case, free, np.vstack([truth, u]), data.at)["torque"][:, 0]
    std = 0.02 * y
    density = np.exp(-0.5 * ((one.table["torque_Nm"][0] - y) / std) ** 2) / std
    found = exact_posterior(recipe.case, one.table, one.truth, SHEAR).log_density
    assert found == pytest.approx(np.log(density[0] / density[1:].mean()), abs=0.05)


def test_the_limit_is_calibrated(recipe):
    every = [j for j in benchmark_sets(recipe, SHEAR) if not j.effect]
    stored = load_limit(packaged_limit(), every)
    truth = np.stack([j.truth for j in every])
    inside = (truth > stored.quantiles[:, 0]) & (truth < stored.quantiles[:, 3])
    np.testing.assert_allclose(inside.mean(axis=0), 0.9, atol=0.02)
    assert np.mean(stored.hpd_levels < 0.9) == pytest.approx(0.9, abs=0.02)
    assert np.mean(stored.flagged) < 0.01


def test_a_stale_limit_is_refused_with_a_hint(recipe, tmp_path, capsys, monkeypatch):
    wanted = benchmark_sets(recipe.sized(seed=recipe.seed + 1), SHEAR, 1)
    with pytest.raises(InputError, match=r"stale.*soilml compare --limit FILE\.parquet"):
        load_limit(packaged_limit(), wanted)
    some = benchmark_sets(recipe, SHEAR, 1)[:2]
    save_limit(
        tmp_path / "two.parquet",
        some,
        [exact_posterior(j.case, j.table, j.truth, SHEAR) for j in some],
    )
    assert load_limit(tmp_path / "two.parquet", some).mean.shape == (2, 3)
    with pytest.raises(InputError, match="has no posterior of set 0"):
        load_limit(tmp_path / "two.parquet", benchmark_sets(recipe, SHEAR, 1))
    with pytest.raises(InputError, match="cannot be read"):
        load_limit(tmp_path / "none.parquet", some)


def test_the_exact_posterior_scores_as_the_limit(results):
    for exact, limit in zip(select(results, "exact"), select(results, LIMIT_LABEL), strict=True):
        np.testing.assert_allclose(exact.rmse_ratio, 1.0, rtol=1e-6)
        np.testing.assert_allclose(exact.rmse_ratio_std, 0.0, atol=1e-6)
        assert exact.joint_coverage90 == pytest.approx(limit.joint_coverage90)


def test_only_an_oracle_has_a_higher_log_score_than_the_limit(results):
    for name in ("prior", "noisy"):
        for other, limit in zip(select(results, name), select(results, LIMIT_LABEL), strict=True):
            assert other.log_score < limit.log_score
    for oracle, limit in zip(select(results, "oracle"), select(results, LIMIT_LABEL), strict=True):
        assert oracle.log_score > limit.log_score > 0.0


def test_an_unmodelled_effect_raises_rmse_and_flags(results):
    for effect in UNMODELLED_EFFECTS:
        known, lacking = (
            select(results, LIMIT_LABEL)[-1],
            select(results, POSTERIOR_LABEL, effect)[-1],
        )
        assert known.design == lacking.design
        assert (lacking.rmse > 1.5 * known.rmse).all()
        assert lacking.flagged_fraction > known.flagged_fraction


def test_the_exact_posterior_meets_the_goals_and_the_prior_misses_them(results):
    by_criterion = {g.criterion: g for g in goals(results) if g.method == "exact"}
    assert by_criterion["every size: RMSE / limit <= 1.05"].met
    function = {"method": "mine", "kind": MethodKind.USER_FUNCTION}
    prior = [replace(r, **function) if r.kind is MethodKind.PRIOR else r for r in results]
    by_criterion = {g.criterion: g for g in goals(prior) if g.method == "mine"}
    assert not by_criterion["every size: RMSE / limit <= 1.05"].met
    assert not next(g for what, g in by_criterion.items() if what.startswith("18 rows")).met


def test_two_methods_of_one_name_are_refused():
    with pytest.raises(InputError, match="two methods are called 'prior'"):
        benchmark({"prior": Estimator.load(EXPORTED / "wheel_linear.onnx")}, max_sets=1)


def test_gaussian_intervals_have_nominal_coverage():
    estimate = gaussian_estimate(np.zeros(2), np.diag([1.0, 4.0]))
    draws = np.random.default_rng(1).normal(size=(20000, 2)) * [1.0, 2.0]
    for ends, share in ((estimate.interval50, 0.5), (estimate.interval90, 0.9)):
        inside = (draws > ends[0]) & (draws < ends[1])
        np.testing.assert_allclose(inside.mean(axis=0), share, atol=0.01)
