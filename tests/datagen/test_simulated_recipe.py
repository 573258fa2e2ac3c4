"""Recipes whose model is another program: rows, and a file for the board, from its runs alone."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import WHEEL_ON_SAND

from datagen.generate import generate
from datagen.recipe import read_recipe
from datagen.simulation import simulate_rows
from soilml import Estimator, Model, Operating, Wheel, soil
from soilml.config.case import read_case
from soilml.experiment_design.simulator_runs import space_filling_runs
from soilml.io.text_tables import csv_text
from training.dataset import read_dataset
from training.export.model_file import export_model
from training.spec import read_spec
from training.train import train

MODEL = (
    WHEEL_ON_SAND
    + """\
[soil.prior]
cohesion = [0.0, 3000.0]
friction_angle = [0.4, 0.8]
shear_modulus = [0.005, 0.03]
"""
)
RECIPE = f"""\
rows = 1000
seed = 2
{MODEL}
[operating]
slip = [0.05, 0.6]
load_N = [30.0, 110.0]
[noise]
torque_Nm = "2 %"
drawbar_pull_N = "2 % + 0.2"
sinkage_m = "2 %"
"""
SIMULATOR = '[simulator]\ntable = "simulated.csv"\nslip = [0.05, 0.6]\nload_N = [30.0, 110.0]\n'
WHEEL = Model(Wheel(radius=0.15, width=0.12))
CHANNELS = {"torque_Nm": "torque", "drawbar_pull_N": "drawbar_pull", "sinkage_m": "sinkage"}


def forces(columns):
    """The channels of the wheel that the runs are of."""
    ground = soil(
        "wong1989/dry_sand",
        cohesion=columns["cohesion_Pa"],
        friction_angle=columns["friction_angle_rad"],
        shear_modulus=columns["shear_modulus_m"],
    )
    force = WHEEL(ground, Operating(slip=columns["slip"], load=columns["load_N"]))
    return {key: getattr(force, name) for key, name in CHANNELS.items()}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    work = tmp_path_factory.mktemp("recipe")
    (work / "model.toml").write_text(MODEL + SIMULATOR)
    design = space_filling_runs(read_case(work / "model.toml", with_simulator=False), 250)
    (work / "simulated.csv").write_text(csv_text(design | forces(design)))
    (work / "recipe.toml").write_text(RECIPE + SIMULATOR)
    (work / "front.toml").write_text(RECIPE)
    return work


@pytest.fixture(scope="module")
def recipe(folder):
    return read_recipe(folder / "recipe.toml")


def test_rows_are_those_of_the_simulator_with_a_draw_of_its_emulator_s_error(recipe):
    quiet = replace(recipe, case=replace(recipe.case, noise={}))
    columns = simulate_rows(quiet, 0, 0, 1000)
    truth, error = forces(columns), recipe.case.simulator.error
    sure = replace(quiet, case=replace(quiet.case, simulator=None))
    without = simulate_rows(sure, 0, 0, 1000)
    for name in CHANNELS:
        drawn = columns[name] - without[name]
        assert np.std(drawn) == pytest.approx(error[name], rel=0.15)  # one draw for each soil
        apart = without[name] - truth[name]
        assert np.sqrt(np.mean(apart**2)) < 1.3 * error[name]  # as stated of new runs


@pytest.mark.long
def test_a_file_trained_on_the_runs_answers_as_one_trained_on_the_equations(folder, tmp_path):
    found = {}
    for name in ("recipe", "front"):
        generate(read_recipe(folder / f"{name}.toml").sized(20_000), tmp_path / f"{name}.parquet")
        spec = read_spec("fused")
        data = read_dataset(tmp_path / f"{name}.parquet", spec.features, spec.targets)
        export_model(train(spec, data), tmp_path / f"{name}.onnx", tmp_path / f"{name}.parquet")
        # a black box has no contact to err in: answers of an exact model are compared
        found[name] = Estimator.load(tmp_path / f"{name}.onnx").on(model_error=0.0)
    rng = np.random.default_rng(9)
    apart, wider = [], []
    for _ in range(40):
        columns = {
            "slip": rng.uniform(0.05, 0.6, 8),
            "load_N": rng.uniform(30.0, 110.0, 8),
            "cohesion_Pa": rng.uniform(0.0, 3000.0),
            "friction_angle_rad": rng.uniform(0.4, 0.8),
            "shear_modulus_m": rng.uniform(0.005, 0.03),
        }
        torque = forces(columns)["torque_Nm"] * (1.0 + 0.02 * rng.standard_normal(8))
        one = {"slip": columns["slip"], "torque": torque, "load": columns["load_N"]}
        box, front = (found[name].run(**one) for name in ("recipe", "front"))
        apart.append((box.mean - front.mean) / front.std)
        wider.append(box.std / front.std)
    assert np.sqrt(np.mean(np.square(apart))) < 0.35
    assert 0.9 < np.mean(wider) < 1.2
