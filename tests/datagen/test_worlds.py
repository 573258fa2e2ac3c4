"""[worlds] in a recipe: effects and smooth errors that act in a share of the runs."""

import numpy as np
import pytest
from conftest import RECIPE

from datagen.recipe import read_recipe
from datagen.simulation import simulate_pieces
from soilml.errors import InputError

RUNS = "\n[[runs]]\nrows = 16\nshare = 1.0\n"


def recipe(tmp_path, worlds="", runs=RUNS, rows=3200):
    path = tmp_path / "recipe.toml"
    path.write_text(RECIPE.format(rows=rows, seed=3) + runs + worlds)
    return read_recipe(path)


def torque(of):
    return np.concatenate([piece["torque_Nm"] for piece in simulate_pieces(of)])


def test_an_effect_acts_in_its_share_of_the_runs_and_in_all_rows_of_a_run(tmp_path):
    plain = torque(recipe(tmp_path)).reshape(-1, 16)
    worlds = '[worlds]\neffect = 0.3\nerror = 0.0\neffects = ["torque-gain"]\n'
    found = torque(recipe(tmp_path, worlds)).reshape(-1, 16)
    gain = found / plain  # the noise is a share of the reading, and the same
    np.testing.assert_allclose(gain, np.broadcast_to(gain[:, :1], gain.shape), rtol=1e-6)
    acted = np.abs(gain[:, 0] - 1.0) > 1e-9
    assert 0.2 < acted.mean() < 0.4
    assert 0.02 < np.std(gain[acted, 0]) < 0.04  # a checked sensor is off by 3 %


def test_a_smooth_error_has_the_usual_size_and_is_shared_by_a_run(tmp_path):
    of = recipe(tmp_path, "[worlds]\neffect = 0.0\nerror = 1.0\n")
    plain, found = torque(recipe(tmp_path)), torque(of)
    error = (found - plain).reshape(-1, 16)
    amplitude = of.worlds.amplitudes["torque_Nm"].constant
    assert np.std(error) == pytest.approx(amplitude, rel=0.15)
    assert np.mean(error, axis=1).std() > 0.6 * amplitude  # noise would leave a quarter


@pytest.mark.parametrize(
    ("worlds", "message"),
    [
        ("effect = 1.5", "effect is 1.5; needed is a share of the runs from 0 to 1"),
        (
            'effects = ["slip-sinkage", "nothing"]',
            "effects has 'nothing', which is none that suits",
        ),
        ('effects = ["multipass"]', "needs pass in"),
        ("effects = []", "no effect is left that can act"),
        ("share = 0.5", "share"),
    ],
)
def test_bad_worlds_are_refused_in_one_line(tmp_path, worlds, message):
    with pytest.raises(InputError, match=message) as error:
        recipe(tmp_path, f"[worlds]\n{worlds}\n")
    assert "\n" not in str(error.value)
