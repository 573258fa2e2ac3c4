"""Wheel-legs learned from simulated strides: slip and soil from torque, vibration and sinkage."""

import json
from dataclasses import replace

import numpy as np
import pytest

from datagen.generate import generate
from datagen.recipe import Block, read_recipe
from soilml.numerics.prior import Prior
from training.dataset import read_dataset
from training.spec import read_spec
from training.train import train

MACHINE = '[[regressor]]\ntype = "fixed-size-lssvm"\ncentres = 30\n'
#: The soil of the packaged recipe, known to a few per cent.
ALMOST = {
    "friction_angle": [0.615, 0.635],
    "shear_modulus": [0.0059, 0.0061],
    "kphi": [580e3, 620e3],
}


@pytest.fixture(scope="module")
def leg_scores(tmp_path_factory):
    """Shares of the prior left by regressors of a wheel-leg's sensors, (targets, regressors + 1).

    The last is that of all joined.
    """
    folder = tmp_path_factory.mktemp("leg")
    recipe = read_recipe("wheel_leg").sized(4000)
    generate(recipe, folder / "unknown.parquet")
    prior = {name: Prior(*ends) for name, ends in ALMOST.items()}
    known = replace(recipe, case=replace(recipe.case, prior=prior), blocks=(Block(1, 1.0),))
    generate(known, folder / "known.parquet")

    def of(data, targets, *read):
        names = list(dict.fromkeys(name for names in read for name in names.split()))
        text = f"features = {json.dumps(names)}\ntargets = {json.dumps(targets)}\n"
        text += "".join(f"{MACHINE}features = {json.dumps(names.split())}\n" for names in read)
        (folder / "s.toml").write_text(text)
        spec = read_spec(folder / "s.toml")
        rows = read_dataset(folder / f"{data}.parquet", spec.features, spec.targets)
        trained = train(spec, rows)
        members = [trained.scores[m.regressor.name].relative for m in trained.members]
        return np.asarray([*members, trained.scores["estimator"].relative]).T

    return of


@pytest.mark.slow
def test_on_known_soil_torque_and_vibration_joined_say_more_of_slip_than_one(leg_scores):
    """Comin and Saaj 2017, section IV-A, with the weights of the correlation of the errors."""
    (shares,) = leg_scores("known", ["slip"], "torque/load load", "vibration load")
    assert shares[-1] < 0.85 * shares[:2].min() < shares[:2].max() < 0.6


@pytest.mark.slow
def test_sinkage_tells_stiffness_and_torque_and_vibration_tell_friction(leg_scores):
    """Comin and Saaj 2017, section IV-B: sinkage for load bearing, slip models for shear."""
    friction, stiffness = leg_scores(
        "unknown",
        ["friction_angle", "normal_stiffness"],
        "slip load torque/load",
        "slip load vibration",
        "load sinkage",
    )
    assert friction[:2].max() < 0.85 < 0.95 < friction[2]
    assert stiffness[2] < 0.4 < 0.8 < stiffness[:2].min()
    assert friction[3] < friction[:3].min() and stiffness[3] < stiffness[:2].min()
