"""Synthetic data: reproducible, whole, calibrated, and honest about failures."""

import hashlib

import numpy as np
import pytest
from conftest import RECIPE

from datagen.generate import generate
from datagen.recipe import read_recipe
from datagen.simulation import simulate_pieces, simulate_rows
from soilml import Model, Operating, Wheel, read_table, soil
from soilml.errors import InputError


def recipe(tmp_path, extra="", rows=600, seed=1, text=RECIPE):
    path = tmp_path / "recipe.toml"
    path.write_text(text.format(rows=rows, seed=seed) + extra)
    return read_recipe(path)


def digest(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


def test_same_recipe_and_seed_give_the_same_bytes(tmp_path):
    for name in ("a", "b"):
        generate(recipe(tmp_path), tmp_path / f"{name}.parquet")
    generate(recipe(tmp_path, seed=2), tmp_path / "c.parquet")
    assert digest(tmp_path / "a.parquet") == digest(tmp_path / "b.parquet")
    assert digest(tmp_path / "a.parquet") != digest(tmp_path / "c.parquet")


def test_rows_do_not_depend_on_the_pieces_they_are_made_in(tmp_path):
    blocks = "[bias]\ntorque_Nm = 0.1\n[[runs]]\nrows = 8\nshare = 1.0\n"
    made = recipe(tmp_path, blocks)
    whole = simulate_rows(made, 0, 0, 600)
    for first, last in ((0, 13), (13, 14), (301, 600)):
        part = simulate_rows(made, 0, first, last)
        for name, values in part.items():
            if values.dtype.kind == "U":
                assert (values == whole[name][first:last]).all()
            else:  # vector units round the last digit by place
                np.testing.assert_allclose(values, whole[name][first:last], rtol=1e-12)


def test_readings_are_the_model_s_with_the_noise_declared(tmp_path):
    generate(recipe(tmp_path, rows=4096), tmp_path / "d.parquet")
    table = read_table(tmp_path / "d.parquet")
    sand = soil(
        "wong1989/dry_sand",
        cohesion=table["cohesion_Pa"],
        friction_angle=table["friction_angle_rad"],
        shear_modulus=table["shear_modulus_m"],
    )
    at = Operating(slip=table["slip"], load=table["load_N"])
    true = Model(Wheel(radius=0.15, width=0.12))(sand, at)
    off = table["torque_Nm"] / true.torque - 1.0
    assert np.std(off) == pytest.approx(0.02, rel=0.05)
    assert abs(np.mean(off)) < 0.0015
    np.testing.assert_allclose(table["sinkage_m"], true.sinkage, rtol=1e-12)  # no noise declared
    for name, low, high in (("slip", 0.05, 0.6), ("load_N", 30, 120), ("cohesion_Pa", 0, 3000)):
        u = np.sort((table[name] - low) / (high - low))
        assert np.abs(u - (np.arange(4096) + 0.5) / 4096).max() < 0.01  # evenly filled


def test_runs_share_soil_and_bias(tmp_path):
    extra = "[bias]\ntorque_Nm = 0.5\n[[runs]]\nrows = 6\nshare = 1.0\n"
    text = RECIPE.replace('torque_Nm = "2 %"', "sinkage_m = 1e-9")
    made = recipe(tmp_path, extra, rows=1200, text=text)
    columns = next(simulate_pieces(made))
    runs = columns["run"].reshape(-1, 6)
    assert (runs == runs[:, :1]).all()
    assert len(np.unique(runs[:, 0])) == 200
    c = columns["cohesion_Pa"].reshape(-1, 6)
    assert (c == c[:, :1]).all()
    sand = soil(
        "wong1989/dry_sand",
        **{n.rsplit("_", 1)[0]: columns[n] for n in ("cohesion_Pa", "friction_angle_rad")},
        shear_modulus=columns["shear_modulus_m"],
    )
    at = Operating(slip=columns["slip"], load=columns["load_N"])
    bias = columns["torque_Nm"] - Model(Wheel(radius=0.15, width=0.12))(sand, at).torque
    bias = bias.reshape(-1, 6)
    np.testing.assert_allclose(bias, np.tile(bias[:, :1], 6), atol=1e-9)
    assert np.std(bias[:, 0]) == pytest.approx(0.5, rel=0.2)


def test_columns_at_levels_take_them_evenly_in_turn_and_in_every_combination(tmp_path):
    levels = ("{ load_N = 3 }", "{ slip = 2, load_N = 3 }")
    blocks = "".join(f"[[runs]]\nrows = 8\nshare = 0.5\nlevels = {one}\n" for one in levels)
    loads, grid = simulate_pieces(recipe(tmp_path, blocks, rows=1600))
    assert not set(loads["run"]) & set(grid["run"])
    assert loads["load_N"][8:16].tolist() == [30.0, 75.0, 120.0] * 2 + [30.0, 75.0]
    assert (np.ptp(loads["slip"].reshape(-1, 8), axis=1) > 0.2).all()
    assert grid["slip"][:8].tolist() == [0.05, 0.6] * 4
    assert grid["load_N"][:8].tolist() == [30.0] * 2 + [75.0] * 2 + [120.0] * 2 + [30.0] * 2
    assert len(np.unique(grid["cohesion_Pa"])) == 100


def test_rows_without_equilibrium_stay_with_their_reason(tmp_path):
    text = RECIPE.replace("[30.0, 120.0]", "[30.0, 3000.0]")
    count = generate(recipe(tmp_path, text=text), tmp_path / "d.parquet")
    table = read_table(tmp_path / "d.parquet", filled=("run",))
    failed = table["status"] != "ok"
    assert 0 < count == failed.sum() < 300
    assert np.isnan(table["torque_Nm"][failed]).all()
    assert np.isfinite(table["torque_Nm"][~failed]).all()


def test_a_recipe_that_mostly_fails_is_refused_and_leaves_nothing(tmp_path):
    text = RECIPE.replace("[30.0, 120.0]", "[30000.0, 120000.0]")
    with pytest.raises(InputError, match="no equilibrium"):
        generate(recipe(tmp_path, text=text), tmp_path / "d.parquet")
    assert not list(tmp_path.glob("*parquet*"))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("[0.05, 0.6]", "[0.05, 1.6]", "needed are slips between -1 and 1"),
        ("[30.0, 120.0]", "[-30.0, 120.0]", "above 0 N"),
        ("rows = {rows}", "rows = 0", "1 or more"),
        ("rows = {rows}", "rows = {rows}\nrow = 3", "did you mean 'rows'"),
        ("seed = {seed}", "", "seed is missing"),
        ("[operating]", "[[runs]]\nrows = 2\nshare = 0.4\n[operating]", "must sum to 1"),
        ("slip = [0.05, 0.6]", "slip = [0.05, 0.6]\nload = [1, 2]", "unknown key 'load'"),
        ("[operating]", '[[runs]]\nsteady = ["load"]\n[operating]', "list of slip, load_N"),
        ("[operating]", '[[runs]]\nsteady = ["slip"]\n[operating]', "2 rows or more"),
        ("[operating]", "[[runs]]\nshare = 0.5\n" * 2 + "[operating]", "merge them"),
        ("[operating]", "[[runs]]\nlevels = {{ load = 3 }}\n[operating]", "did you mean 'load_N'"),
        ("[operating]", "[[runs]]\nlevels = {{ slip = 1 }}\n[operating]", "or steady"),
        ("[operating]", "[[runs]]\nlevels = {{ slip = 3 }}\n[operating]", "3 combinations"),
        (
            "[operating]",
            '[[runs]]\nrows = 3\nsteady = ["slip"]\nlevels = {{ slip = 3 }}\n[operating]',
            "in steady and in levels",
        ),
    ],
)
def test_mistakes_in_a_recipe_are_named(tmp_path, old, new, said):
    assert old in RECIPE
    with pytest.raises(InputError, match=said):
        recipe(tmp_path, text=RECIPE.replace(old, new))
