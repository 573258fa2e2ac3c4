"""The fixed benchmark: sets, Bayes limit, scores of methods, acceptance goals."""

import json
import shutil
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
    design_of,
    generate_design_sets,
    select_channels,
    set_hash,
)
from training.benchmark.methods import (
    MethodKind,
    classify_estimator,
    gaussian_estimate,
    model_file_method,
)
from training.benchmark.suite import (
    LIMIT_LABEL,
    POSTERIOR_LABEL,
    RECIPE,
    benchmark,
)

pytestmark = pytest.mark.slow

FEW = 4
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


def test_the_recipe_has_the_designs_of_the_benchmark(recipe):
    designs = [design_of(block) for block in recipe.blocks]
    assert [d.rows for d in designs] == [1, 3, 6, 8, 16, 3, 6, 8, 16, 18]
    for sets in generate_design_sets(recipe, SHEAR, FEW):
        for table in sets.tables:
            assert len(table) == sets.design.rows
            assert len(np.unique(table["load_N"])) == sets.design.loads
    grid = sets.tables[0]  # the last design
    assert len(np.unique(grid["slip"])) == 6
    assert len(np.unique(np.stack([grid["slip"], grid["load_N"]]), axis=1).T) == 18


def test_no_released_model_was_trained_on_the_benchmark(recipe):
    files = sorted(EXPORTED.glob("*.onnx"))
    seeds = [json.loads(Estimator.load(file).metadata["recipe"]).get("seed") for file in files]
    assert files and recipe.seed not in [*seeds, read_recipe("wheel_test").seed]


def test_the_first_sets_do_not_depend_on_their_number(recipe):
    few, more = generate_design_sets(recipe, SHEAR, 2), generate_design_sets(recipe, SHEAR, 5)
    for one, other in zip(few, more, strict=True):
        for a, b in zip(one.tables, other.tables, strict=False):
            assert set_hash(a, recipe.case) == set_hash(b, recipe.case)


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


def test_an_oracle_beats_the_limit_and_the_prior_does_not(results):
    for oracle, prior in zip(select(results, "oracle"), select(results, "prior"), strict=True):
        assert (oracle.rmse_ratio < 1e-4).all()
        assert prior.log_score == 0.0
        if prior.design.rows > 3:
            assert prior.rmse_ratio[2] > 1.0


def test_only_an_oracle_has_a_higher_log_score_than_the_limit(results):
    for name in ("prior", "noisy"):
        for other, limit in zip(select(results, name), select(results, LIMIT_LABEL), strict=True):
            assert other.log_score < limit.log_score
    for oracle, limit in zip(select(results, "oracle"), select(results, LIMIT_LABEL), strict=True):
        assert oracle.log_score > limit.log_score > 0.0


def test_the_jackknife_agrees_with_the_bootstrap(results):
    result = select(results, "noisy")[-1]
    rng = np.random.default_rng(0)
    own, limit = result.error**2, (result.limit_mean - result.truth) ** 2
    resampled = rng.integers(0, result.sets, (4000, result.sets))
    ratios = np.sqrt(own[resampled].sum(axis=1) / limit[resampled].sum(axis=1))
    np.testing.assert_allclose(result.rmse_ratio_std, ratios.std(axis=0), rtol=0.6)


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


def test_a_model_file_is_one_method_whose_kind_is_in_its_metadata(small_model):
    single = model_file_method("small", Estimator.load(small_model))
    assert (single.label, single.kind) == ("small", MethodKind.REGRESSION)
    of_sets = model_file_method("wheel", Estimator.load(EXPORTED / "wheel.onnx"))
    assert (of_sets.label, of_sets.kind) == ("wheel", MethodKind.SET_POSTERIOR)


@pytest.mark.parametrize(
    ("file", "kind"),
    [
        ("wheel", MethodKind.SET_POSTERIOR),
        ("any_wheel", MethodKind.SET_POSTERIOR),
        ("kls1_wheel", MethodKind.SET_POSTERIOR),
        ("wheel_lssvm", MethodKind.REGRESSION),
        ("wheel_mlp", MethodKind.REGRESSION),
        ("wheel_linear", MethodKind.LINEAR_REGRESSION),
    ],
)
def test_the_kind_of_a_file_is_read_from_its_metadata(tmp_path, file, kind):
    for name in (file, "my_mlp", "prior", "linear, pooled"):
        copied = shutil.copy(EXPORTED / f"{file}.onnx", tmp_path / f"{name}.onnx")
        assert classify_estimator(Estimator.load(copied)) is kind


def test_goals_do_not_depend_on_the_name_of_a_file(tmp_path):
    names = {"wheel": "my_mlp", "wheel_mlp": "wheel", "wheel_linear": "best_lssvm"}
    copies = {
        name: Estimator.load(shutil.copy(EXPORTED / f"{file}.onnx", tmp_path / f"{name}.onnx"))
        for file, name in names.items()
    }
    released = {file: Estimator.load(EXPORTED / f"{file}.onnx") for file in names}
    found = goals(benchmark(released, max_sets=3, analytic=()))
    again = goals(benchmark(copies, max_sets=3, analytic=()))
    assert [replace(g, method=names.get(g.method, g.method)) for g in found] == again
    assert {g.method for g in found} == {LIMIT_LABEL, "wheel", "wheel_mlp"}
    criteria = [g.criterion for g in found if g.method == "wheel"]
    assert len(criteria) == 6 and criteria[0] == "every size: RMSE / limit <= 1.05"
    assert [g.criterion for g in found if g.method == "wheel_mlp"] == [
        "1 row: RMSE / limit <= 1.01"
    ]


def test_two_methods_of_one_name_are_refused():
    with pytest.raises(InputError, match="two methods are called 'prior'"):
        benchmark({"prior": Estimator.load(EXPORTED / "wheel_linear.onnx")}, max_sets=1)


def test_gaussian_intervals_have_nominal_coverage():
    estimate = gaussian_estimate(np.zeros(2), np.diag([1.0, 4.0]))
    draws = np.random.default_rng(1).normal(size=(20000, 2)) * [1.0, 2.0]
    for ends, share in ((estimate.interval50, 0.5), (estimate.interval90, 0.9)):
        inside = (draws > ends[0]) & (draws < ends[1])
        np.testing.assert_allclose(inside.mean(axis=0), share, atol=0.01)
