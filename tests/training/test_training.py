"""Training: rows left out, calibration, specs, cards and plots."""

from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest
from conftest import RECIPE

from datagen.generate import generate
from datagen.recipe import read_recipe
from soilml import Estimator, read_table
from soilml.errors import InputError, TableError
from training.dataset import read_dataset
from training.regressors.linear_gaussian import LinearGaussian
from training.spec import read_spec
from training.train import train

FEATURES = ("slip", "torque/load", "load")
TARGETS = ("cohesion", "friction_angle", "shear_modulus")


@pytest.fixture(scope="module")
def data(small_data):
    return read_dataset(small_data, FEATURES, TARGETS)


def test_every_row_trains_and_is_estimated_by_a_fit_that_has_not_seen_its_run(data):
    """Estimates of rows left out are as good as those of rows of another seed, and no better."""
    spec = read_spec("linear")
    trained = train(spec, data)
    member = LinearGaussian().fit(data.features, data.targets)
    expected = np.clip(member.predict(data.features), data.lower, data.upper)
    np.testing.assert_allclose(trained.predict(data.features)[0], expected)
    left = trained.left_out
    seen = np.sqrt(np.mean((member.predict(data.features) - data.targets) ** 2, axis=0))
    unseen = np.sqrt(np.mean((left.mean - data.targets) ** 2, axis=0))
    assert (unseen > seen).all() and (unseen < 1.02 * seen).all()
    wrong = replace(data, targets=np.where(data.run[:, None] == 0, data.upper, data.targets))
    other = train(spec, wrong).left_out
    out = data.run == 0
    # its own targets do not change the estimates of a run, but they change those of others
    np.testing.assert_allclose(other.mean[out], left.mean[out], rtol=1e-9)
    assert (other.mean[~out] != left.mean[~out]).any()


def test_train_writes_the_model_card(small_model):
    card = small_model.with_suffix(".md").read_text()
    for text in ("cohesion", "in_range", "sha256", "90 %", "mostly the prior"):
        assert text in card


def test_the_exported_intervals_hold_on_data_of_another_seed(small_model, tmp_path):
    (tmp_path / "r.toml").write_text(RECIPE.format(rows=4000, seed=77))
    generate(read_recipe(tmp_path / "r.toml"), tmp_path / "t.parquet")
    table = read_table(tmp_path / "t.parquet")
    found = Estimator.load(small_model)(
        slip=table["slip"], torque=table["torque_Nm"], load=table["load_N"]
    )
    truth = np.stack([table[c] for c in ("cohesion_Pa", "friction_angle_rad", "shear_modulus_m")])
    inside = np.mean((found.low <= truth.T) & (found.high >= truth.T), axis=0)
    assert (np.abs(inside - 0.9) < 0.05).all()
    assert found.in_range.mean() > 0.99
    # and they are narrower than the prior's, where one reading can tell anything
    assert np.median(found.std[:, 2]) < 0.85 * found.prior_std[2]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "regressor]] is missing"),
        ('[[regressor]]\ntype = "forest"\n', "fixed-size-lssvm, mlp, linear"),
        ('[[regressor]]\ntype = "mlp"\nlayers = [3]\n', "unknown key 'layers'"),
        ('[[regressor]]\ntype = "mlp"\nhidden = [0]\n', "whole numbers from 1 to 4096"),
        ('[[regressor]]\ntype = "mlp"\nepochs = 0\n', "1 or more"),
        ('[[regressor]]\ntype = "lssvm"\ngamma = -1.0\n', "above zero"),
        ('features = ["slip", "colour"]\n[[regressor]]\ntype = "mlp"\n', "'colour' is none of"),
        ('targets = ["depth"]\n[[regressor]]\ntype = "mlp"\n', "'depth' cannot be estimated"),
    ],
)
def test_invalid_entries_of_a_spec_are_named(tmp_path, text, message):
    path = tmp_path / "spec.toml"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        read_spec(path)
    assert message in str(caught.value)


def test_data_without_targets_or_with_too_few_rows_is_refused(tmp_path, small_data):
    with pytest.raises(TableError, match="kphi_SI is missing"):
        read_dataset(small_data, FEATURES, ("kphi",))
    few = pq.read_table(small_data).slice(0, 11)
    pq.write_table(few, tmp_path / "few.parquet")
    with pytest.raises(TableError, match="11 usable rows; needed are 12"):
        read_dataset(tmp_path / "few.parquet", FEATURES, TARGETS)
