"""Another program in place of the equations: here soilml's own wheel, as a table of its runs."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import WHEEL_ON_SAND

from soilml import Model, Operating, Wheel, identify, read_case, soil
from soilml.cli import main
from soilml.errors import InputError
from soilml.experiment_design.simulator_runs import space_filling_runs
from soilml.io.read_table import read_table
from soilml.io.text_tables import csv_text
from soilml.quantities import column

MODEL = (
    WHEEL_ON_SAND
    + """\
[soil.prior]
cohesion = [0.0, 3000.0]
friction_angle = [0.4, 0.8]
shear_modulus = { range = [0.005, 0.04], scale = "log" }
[noise]
torque_Nm = "2 %"
drawbar_pull_N = "2 % + 0.2"
sinkage_m = "2 %"
"""
)
SIMULATOR = '[simulator]\ntable = "simulated.csv"\nslip = [0.05, 0.6]\nload_N = [30.0, 110.0]\n'
TRUTH = {"cohesion": 1300.0, "friction_angle": 0.55, "shear_modulus": 0.016}
INPUTS = ("slip", "load_N", "cohesion_Pa", "friction_angle_rad", "shear_modulus_m")
WHEEL = Model(Wheel(radius=0.15, width=0.12))


def simulate(design):
    """The wheel's channels for columns of a design."""
    ground = soil(
        "wong1989/dry_sand",
        cohesion=design["cohesion_Pa"],
        friction_angle=design["friction_angle_rad"],
        shear_modulus=design["shear_modulus_m"],
    )
    force = WHEEL(ground, Operating(slip=design["slip"], load=design["load_N"]))
    channels = {"torque": force.torque, "drawbar_pull": force.drawbar_pull}
    return {column(n): v for n, v in (channels | {"sinkage": force.sinkage}).items()}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The front door, the same wheel as 120 runs of a simulator, and 15 noisy rows of a soil."""
    work = tmp_path_factory.mktemp("simulator")
    (work / "front.toml").write_text(MODEL)
    (work / "black_box.toml").write_text(MODEL + SIMULATOR)
    case = read_case(work / "black_box.toml", with_simulator=False)
    design = space_filling_runs(case, 120)
    (work / "simulated.csv").write_text(csv_text(design | simulate(design)))
    slip, load = np.tile([0.08, 0.15, 0.25, 0.38, 0.52], 3), np.repeat([40.0, 65.0, 100.0], 5)
    force = WHEEL(soil("wong1989/dry_sand", **TRUTH), Operating(slip=slip, load=load))
    noise = 1 + 0.02 * np.random.default_rng(4).standard_normal((3, 15))
    channels = (force.torque, force.drawbar_pull, force.sinkage)
    names = ("torque_Nm", "drawbar_pull_N", "sinkage_m")
    rows = {"run": np.full(15, "a"), "slip": slip, "load_N": load}
    rows |= dict(zip(names, noise * channels, strict=True))
    (work / "runs.csv").write_text(csv_text(rows))
    return work


@pytest.fixture(scope="module")
def box(folder):
    """The case of the simulator; its emulator is fitted once."""
    return read_case(folder / "black_box.toml")


def inputs_at(gear, u):
    """Inputs (m, d) of a simulator at points of the unit cube."""
    low, high = np.asarray(gear.lower), np.asarray(gear.upper)
    with np.errstate(all="ignore"):
        return np.where(gear.logarithmic, low * (high / low) ** u, low + u * (high - low))


def test_the_error_that_is_stated_is_that_of_runs_that_the_emulator_has_not_seen(box):
    rng, gear = np.random.default_rng(5), box.model.gear
    x = inputs_at(gear, rng.random((400, 5)))
    assert gear.inputs == ("slip", "load", "cohesion", "friction_angle", "shear_modulus")
    assert gear.logarithmic == (False, True, False, False, True)
    truth, found = simulate(dict(zip(INPUTS, x.T, strict=True))), gear.emulate(gear.fractions(x))
    for i, (name, stated) in enumerate(box.simulator.error.items()):
        error = np.sqrt(np.mean((found[:, i] - truth[name]) ** 2))
        # an upper estimate, of three quarters of the runs: 1.5 to 1.7 times the error here
        assert 0.3 * stated < error < 1.3 * stated
        assert stated < 0.03 * np.std(truth[name])
        assert box.discrepancy[name].constant == stated


def test_the_wheel_as_a_black_box_gives_the_soil_of_the_front_door(folder, box):
    rows = read_table(folder / "runs.csv")
    front = identify(read_case(folder / "front.toml"), rows, method="posterior")
    found = identify(box, rows, method="posterior")
    assert found.names == front.names
    # apart by no more than the emulator's error makes the intervals wider: at most 0.9 of it in 32
    # sets of rows, four designs of 120 and 160 runs
    apart = np.abs(found.values - front.values)
    assert np.all(found.std > front.std) and np.all(found.std < 2.5 * front.std)
    assert np.all(apart < np.sqrt(found.std**2 - front.std**2))
    for name, value in TRUTH.items():
        assert abs(found[name] - value) < 3.0 * found.std[found.names.index(name)]
    # a wrong error would be wrong intervals: without it they are those of an exact model
    blind = identify(replace(box, discrepancy={}, simulator=None), rows, method="posterior")
    assert np.all(blind.std < found.std)


def test_outside_the_runs_there_is_no_answer(box):
    at = Operating(slip=np.asarray([0.2, 0.2, 0.95]), load=np.asarray([60.0, 200.0, 60.0]))
    force = box.model(box.soil, at)
    assert force.status.tolist() == [0, 5, 5] and np.isnan(force.torque[1:]).all()
    with pytest.raises(InputError, match="asks for the contact of its wheel"):
        box.model.profile(box.soil, Operating(slip=0.2, load=60.0))


def test_plan_runs_proposes_runs_and_further_ones(workplace, capsys):
    (workplace / "model.toml").write_text(MODEL + SIMULATOR)
    assert main(["plan", "runs", "model.toml", "--count", "40", "--out", "design.csv"]) == 0
    design = dict(read_table("design.csv", filled=()).columns)
    assert len(design["slip"]) == 40 and set(design) == set(INPUTS)
    Path("simulated.csv").write_text(csv_text(design | simulate(design)))
    capsys.readouterr()
    assert main(["plan", "runs", "model.toml", "--count", "10", "--out", "more.csv"]) == 0
    assert "error of the emulator of torque_Nm: " in capsys.readouterr().err
    assert len(read_table("more.csv", filled=())) == 10
    assert main(["plan", "runs", "model.toml", "--out", "simulated.csv"]) == 2
    assert "simulated.csv is an input and would be overwritten" in capsys.readouterr().err
    assert read_case("model.toml").simulator.error["torque_Nm"] > 0.0
    fewer = (MODEL + SIMULATOR).replace("cohesion = [0.0, 3000.0]\n", "")
    (workplace / "model.toml").write_text(fewer)
    assert main(["plan", "runs", "model.toml", "--out", "most.csv"]) == 2
    assert "varies cohesion_Pa, which has no prior" in capsys.readouterr().err


def refused(tmp_path, text="", table=None):
    """The message of a model with a simulator."""
    (tmp_path / "model.toml").write_text(MODEL + (text or SIMULATOR))
    if table is not None:
        (tmp_path / "simulated.csv").write_text(csv_text(table))
    with pytest.raises(InputError) as found:
        read_case(tmp_path / "model.toml")
    assert "\n" not in str(found.value)
    return str(found.value)


def test_runs_that_cannot_stand_in_for_equations_are_refused(folder, tmp_path):
    columns = dict(read_table(folder / "simulated.csv").columns)
    assert "`soilml plan runs` proposes" in refused(tmp_path)
    few = {name: values[:20] for name, values in columns.items()}
    assert "20 runs for 5 inputs" in refused(tmp_path, table=few)
    gone = {name: values.copy() for name, values in columns.items()}
    gone["torque_Nm"][7] = np.nan
    assert "line 9: the run has no torque_Nm" in refused(tmp_path, table=gone)
    twice = {name: np.append(values, values[0]) for name, values in columns.items()}
    twice["torque_Nm"][-1] += 0.1
    assert "differs from an earlier one with the same inputs" in refused(tmp_path, table=twice)
    narrow = {n: v[columns["cohesion_Pa"] < 1500.0] for n, v in columns.items()}
    assert "the prior of cohesion, 0 to 3000, reaches beyond" in refused(tmp_path, table=narrow)
    fixed = {name: v for name, v in columns.items() if name != "cohesion_Pa"}
    assert "does not vary cohesion, which has a prior" in refused(tmp_path, table=fixed)
    blind = {name: columns[name] for name in ("slip", "load_N", "cohesion_Pa")}
    assert "no run has torque_Nm" in refused(tmp_path, table=blind)
    assert "[lowest, highest], between -1 and 1" in refused(
        tmp_path, SIMULATOR.replace("0.6]", "1.6]")
    )


def test_rows_outside_the_runs_are_refused(folder, tmp_path, capsys):
    text = (folder / "runs.csv").read_text().replace("a,0.52,100,", "a,0.52,180,")
    (tmp_path / "runs.csv").write_text(text)
    assert main(["identify", str(folder / "black_box.toml"), str(tmp_path / "runs.csv")]) == 2
    said = capsys.readouterr().err
    assert "load_N: 180 is outside the runs of the simulator" in said


@pytest.mark.slow
def test_gap_works_on_a_black_box_and_writes_a_model_that_has_it(folder, tmp_path):
    """A torque sensor that reads 12 % too much, of which no soil is the cause."""
    table = dict(read_table(folder / "runs.csv").columns)
    table["torque_Nm"] = 1.12 * table["torque_Nm"]
    (tmp_path / "runs.csv").write_text(csv_text(table))
    model = str(folder / "black_box.toml")
    assert main(["gap", model, str(tmp_path / "runs.csv"), "--out", str(tmp_path / "gap")]) == 0
    report = json.loads((tmp_path / "gap/gap.json").read_text())
    assert report["status"] != "no-gap"
    again = read_case(tmp_path / "gap/model.toml", with_explanations=True)
    assert again.simulator is not None and again.model.gear.name == "simulator"
