"""The fixed benchmark: its sets, its limit, what is said of a method, and its goals."""

import csv
import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from datagen.recipe import read_recipe
from soilml import Estimator
from soilml.cli import main
from soilml.errors import InputError
from soilml.identification import identify
from soilml.quantities import SHEAR
from training.benchmark.acceptance import goals
from training.benchmark.bayes_limit import UNKNOWN, exact_posterior, jobs
from training.benchmark.bayes_limit_file import load, save, shipped
from training.benchmark.designs import design_of, fingerprint, sets_of, shown
from training.benchmark.methods import ANALYTIC, gaussian, trained
from training.benchmark.suite import ASKED, LIMIT, POSTERIOR, RECIPE, benchmark

FEW = 4


@pytest.fixture(scope="module")
def recipe():
    return read_recipe(RECIPE)


@pytest.fixture(scope="module")
def results(recipe):
    found = jobs(recipe, SHEAR, 12)
    limit = load(shipped(), found)
    places = {job.table["torque_Nm"].tobytes(): i for i, job in enumerate(found)}

    def again(slip, torque, load):
        i = places[torque.tobytes()]
        return limit.mean[i], limit.covariance[i]

    def astray(slip, torque, load):
        i = places[torque.tobytes()]
        std = np.sqrt(np.diag(limit.covariance[i]))
        return limit.mean[i] + 0.8 * std * np.random.default_rng(i).normal(size=3), std

    def cheat(slip, torque, load):
        truth = found[places[torque.tobytes()]].truth
        return 1.0000001 * truth, 1e-6 * truth

    own = {"limit again": again, "astray": astray, "cheat": cheat}
    return benchmark(own=own, most=12, named=())


def picked(results, method, effect=""):
    return [r for r in results if r.method == method and r.effect == effect]


def test_the_recipe_drives_the_sizes_and_loads_that_it_says(recipe):
    designs = [design_of(block) for block in recipe.blocks]
    assert [d.rows for d in designs] == [1, 3, 6, 8, 16, 3, 6, 8, 16, 18]
    for sets in sets_of(recipe, SHEAR, FEW):
        for table in sets.tables:
            assert len(table) == sets.design.rows
            assert len(np.unique(table["load_N"])) == sets.design.loads
    grid = sets.tables[0]  # the last design
    assert len(np.unique(grid["slip"])) == 6
    assert len(np.unique(np.stack([grid["slip"], grid["load_N"]]), axis=1).T) == 18


def test_no_released_model_was_trained_on_the_benchmark(recipe):
    files = sorted((Path(__file__).parents[3] / "exported").glob("*.onnx"))
    seeds = [json.loads(Estimator.load(file).metadata["recipe"]).get("seed") for file in files]
    assert files and recipe.seed not in [*seeds, read_recipe("wheel_test").seed]


def test_the_first_sets_stay_the_same_however_many_are_made(recipe):
    few, more = sets_of(recipe, SHEAR, 2), sets_of(recipe, SHEAR, 5)
    for one, other in zip(few, more, strict=True):
        for a, b in zip(one.tables, other.tables, strict=False):
            assert fingerprint(a, recipe.case) == fingerprint(b, recipe.case)


def test_the_limit_that_comes_with_the_package_is_the_exact_posterior(recipe):
    """A handful of sets again, by the model itself and not by its polynomial."""
    every = jobs(recipe, SHEAR)
    kept = load(shipped(), every)
    for i in np.flatnonzero([j.number == 7 and not j.effect for j in every])[[0, 1, 6, 9]]:
        job = every[i]
        fit = identify(recipe.case, shown(job.table, ["torque"]), list(SHEAR), "posterior")
        np.testing.assert_allclose((kept.mean[i] - fit.values) / fit.std, 0.0, atol=0.12)
        std = np.sqrt(np.diag(kept.covariance[i]))
        np.testing.assert_allclose(std / fit.std, 1.0, atol=0.1)
        np.testing.assert_allclose((kept.quantiles[i, 0] - fit.low) / fit.std, 0.0, atol=0.25)
        np.testing.assert_allclose((kept.quantiles[i, 3] - fit.high) / fit.std, 0.0, atol=0.25)
        again = exact_posterior(recipe.case, job.table, job.truth, SHEAR)
        assert kept.density[i] == pytest.approx(again.density, abs=0.1)


def test_the_density_at_the_truth_is_the_integral_s_share(recipe):
    """One row: likelihood at the truth over its mean on a lattice of the whole prior."""
    from soilml.identification.free_parameters import select_free
    from soilml.identification.observations import read_observations
    from soilml.identification.predictions import predicted

    job = jobs(recipe, SHEAR, 1)[0]
    data = read_observations(recipe.case, shown(job.table, ["torque"]))
    free = select_free(recipe.case, SHEAR)
    side = (np.arange(24) + 0.5) / 24
    u = np.stack(np.meshgrid(side, side, side), axis=-1).reshape(-1, 3)
    truth = [f.prior.fraction(t) for f, t in zip(free, job.truth, strict=True)]
    y = predicted(recipe.case, free, np.vstack([truth, u]), data.at)["torque"][:, 0]
    std = 0.02 * y
    density = np.exp(-0.5 * ((job.table["torque_Nm"][0] - y) / std) ** 2) / std
    found = exact_posterior(recipe.case, job.table, job.truth, SHEAR).density
    assert found == pytest.approx(np.log(density[0] / density[1:].mean()), abs=0.05)


def test_the_limit_holds_what_it_claims(recipe):
    every = [j for j in jobs(recipe, SHEAR) if not j.effect]
    kept = load(shipped(), every)
    truth = np.stack([j.truth for j in every])
    inside = (truth > kept.quantiles[:, 0]) & (truth < kept.quantiles[:, 3])
    np.testing.assert_allclose(inside.mean(axis=0), 0.9, atol=0.02)
    assert np.mean(kept.denser < 0.9) == pytest.approx(0.9, abs=0.02)
    assert np.mean(kept.flagged) < 0.01


def test_a_stale_limit_is_refused_with_the_way_out(recipe, tmp_path, capsys, monkeypatch):
    wanted = jobs(recipe.sized(seed=recipe.seed + 1), SHEAR, 1)
    with pytest.raises(InputError, match=r"stale.*soilml compare --limit FILE\.parquet"):
        load(shipped(), wanted)
    some = jobs(recipe, SHEAR, 1)[:2]
    save(
        tmp_path / "two.parquet",
        some,
        [exact_posterior(j.case, j.table, j.truth, SHEAR) for j in some],
    )
    assert load(tmp_path / "two.parquet", some).mean.shape == (2, 3)
    with pytest.raises(InputError, match="has no limit for set 0"):
        load(tmp_path / "two.parquet", jobs(recipe, SHEAR, 1))
    with pytest.raises(InputError, match="cannot be read"):
        load(tmp_path / "none.parquet", some)


def test_what_answers_as_the_limit_scores_as_the_limit(results):
    for again, least in zip(picked(results, "limit again"), picked(results, LIMIT), strict=True):
        np.testing.assert_allclose(again.ratio, 1.0, rtol=1e-6)
        np.testing.assert_allclose(again.ratio_std, 0.0, atol=1e-6)
        assert again.joint90 == pytest.approx(least.joint90)


def test_what_knows_the_soil_is_better_than_the_limit_and_what_knows_nothing_is_worse(results):
    for cheat, prior in zip(picked(results, "cheat"), picked(results, "prior"), strict=True):
        assert (cheat.ratio < 1e-4).all()
        assert prior.log_density == 0.0
        if prior.design.rows > 3:
            assert prior.ratio[2] > 1.0


def test_no_claim_gives_the_truth_more_density_than_the_limit_but_one_that_knows_it(results):
    for name in ("prior", "astray"):
        for other, least in zip(picked(results, name), picked(results, LIMIT), strict=True):
            assert other.log_density < least.log_density
    for cheat, least in zip(picked(results, "cheat"), picked(results, LIMIT), strict=True):
        assert cheat.log_density > least.log_density > 0.0


def test_the_standard_error_of_the_ratio_is_that_of_resampled_sets(results):
    result = picked(results, "astray")[-1]
    rng = np.random.default_rng(0)
    own, least = result.error**2, (result.limit - result.truth) ** 2
    drawn = rng.integers(0, result.sets, (4000, result.sets))
    ratios = np.sqrt(own[drawn].sum(axis=1) / least[drawn].sum(axis=1))
    np.testing.assert_allclose(result.ratio_std, ratios.std(axis=0), rtol=0.6)


def test_an_effect_that_no_method_knows_is_seen_in_the_figures(results):
    for effect in UNKNOWN:
        known, lacking = picked(results, LIMIT)[-1], picked(results, POSTERIOR, effect)[-1]
        assert known.design == lacking.design
        assert (lacking.rmse > 1.5 * known.rmse).all()
        assert lacking.flagged > known.flagged


def test_goals_are_met_by_the_limit_s_equal_and_missed_by_the_prior_s(results):
    said = {g.what: g for g in goals(results, LIMIT) if g.method == "limit again"}
    assert said["every size: RMSE / limit <= 1.05"].met
    prior = [replace(r, method="mine") if r.method == "prior" else r for r in results]
    said = {g.what: g for g in goals(prior, LIMIT) if g.method == "mine"}
    assert not said["every size: RMSE / limit <= 1.05"].met
    assert not next(g for what, g in said.items() if what.startswith("18 rows")).met


def test_a_file_that_joins_rows_in_two_ways_gets_two_lines(small_model, recipe):
    estimator = Estimator.load(small_model)
    assert [m.name for m in trained("wheel", estimator)] == ["wheel"]

    class Both:
        inputs, joined, run = estimator.inputs, estimator.run, estimator.run
        sets = SimpleNamespace(alone=False)

        def __call__(self, **readings):
            return estimator(**readings)

    both = trained("wheel", Both())
    assert [m.name for m in both] == ["wheel, joined", "wheel"]
    for sets in sets_of(recipe, SHEAR, 1)[:3]:
        one, other = (method.ask(sets.tables[0]) for method in both)
        np.testing.assert_array_equal(one.mean, np.squeeze(other.mean))


def test_a_gaussian_s_intervals_hold_what_they_say():
    answer = gaussian(np.zeros(2), np.diag([1.0, 4.0]))
    draws = np.random.default_rng(1).normal(size=(20000, 2)) * [1.0, 2.0]
    for ends, share in ((answer.inner, 0.5), (answer.outer, 0.9)):
        inside = (draws > ends[0]) & (draws < ends[1])
        np.testing.assert_allclose(inside.mean(axis=0), share, atol=0.01)


def test_the_command_writes_tables_picture_and_goals(small_model, tmp_path, capsys):
    out = tmp_path / "found"
    assert main(["compare", str(small_model), "--sets", "3", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "18 rows, three loads, slips in a grid" in said and "limit's own" in said
    rows = list(csv.DictReader((out / "benchmark.csv").open()))
    assert {r["method"] for r in rows} == {
        LIMIT, POSTERIOR, "prior", "small", *(f"{ANALYTIC}{name}" for name in ASKED),
    }  # fmt: skip
    assert {r["unknown_effect"] for r in rows} == {"", *UNKNOWN}
    assert (out / "benchmark.png").stat().st_size > 20_000
    assert "## Goals" in (out / "benchmark.md").read_text()


def test_without_the_released_models_the_command_says_where_they_are(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["compare"]) == 2
    assert "run it in a clone of the repository" in capsys.readouterr().err
    assert main(["compare", "a.toml", "b.parquet"]) == 2
    assert "needed are MODEL.toml TEST.parquet" in capsys.readouterr().err
    assert main(["compare", "--limit", "limit.csv"]) == 2
    assert "....parquet" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_the_limit_is_computed_anew_over_what_was_there_and_used(small_model, tmp_path, capsys):
    file, out = tmp_path / "limit.parquet", tmp_path / "found"
    file.write_text("old")
    assert main(["compare", "--limit", str(file), "--sets", "1"]) == 0
    command = ["compare", str(small_model), "--out", str(out), "--against", str(file), "--sets"]
    assert main([*command, "2"]) == 2
    assert "has no limit for set 1" in capsys.readouterr().err
    assert not out.exists()
