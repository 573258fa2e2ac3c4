"""The whole workflow on runs driven with the package's own wheel."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from gap_sets import MODEL, analysed, case_of, driven, hidden

from soilml.cli import main
from soilml.config.write_case import case_as_toml
from soilml.gap import gap
from soilml.physics.effects import EFFECTS

pytestmark = pytest.mark.slow

FEW = {n: EFFECTS[n] for n in ("slip-sinkage", "bulldozing", "exit-angle", "torque-gain")}


@pytest.fixture(scope="module")
def dug():
    """Six runs in which the wheel digs itself in."""
    case = case_of()
    loads = (40.0, 60.0, 90.0, 140.0, 50.0, 110.0)
    return case, driven(case, [EFFECTS["slip-sinkage"](n1=0.4)], loads=loads, slips=6, seed=2)


@pytest.fixture(scope="module")
def report(dug):
    """What a small catalogue tells of them."""
    return gap(*dug, effects=FEW)


def answers(report):
    """Everything that is found, without the figures on rows held out."""
    content = report.as_json()
    content["gap"] = {k: v for k, v in content["gap"].items() if "held out" not in v["description"]}
    content["notes"] = [r for r in content["notes"] if r["code"] != "not-reduced"]
    content["not_claimed"] = [r for r in content["not_claimed"] if "held out" not in r["text"]]
    return content


def test_the_same_rows_and_seed_give_the_same_answer():
    case, table, _, _ = hidden("exit-angle")
    shares: list[float] = []
    again = gap(case, table, progress=shares.append)
    assert again.as_json() == analysed("exit-angle").as_json()
    # the posterior is computed once for the same rows and case, and then takes no time
    assert shares == sorted(set(shares)) and all(0.0 < share < 1.0 for share in shares)


def test_the_seed_is_that_of_the_draws_and_changes_no_fit(dug, report):
    other = gap(*dug, effects=FEW, seed=1)
    assert report.seed == 0 and other.seed == 1
    assert report.cause_set == other.cause_set == (("slip-sinkage",),)
    assert report.soil_before == other.soil_before and report.model.soil == other.model.soil


def test_a_larger_catalogue_does_not_change_what_is_true(dug):
    found = gap(*dug)
    assert ("slip-sinkage",) in found.cause_set
    assert found.effects[0].parameters["n1"].value == pytest.approx(0.4, abs=0.03)


def test_without_the_cause_in_the_catalogue_nothing_is_named_for_sure(dug):
    others = {n: e for n, e in FEW.items() if n != "slip-sinkage"}
    found = gap(*dug, effects=others)
    assert found.status in ("unknown", "class", "suspected", "form-open")
    assert found.gap_probability > 0.999


@pytest.mark.parametrize("holdout", ["run", "load_N=140", "run=run_4"])
def test_held_out_rows_change_only_their_own_figures(dug, holdout):
    case, table = dug
    report = gap(case, table, effects=FEW, holdout=holdout, seed=3)
    (what,) = {s.description for s in report.gap.values() if "held out" in s.description}
    if holdout == "run":
        back = np.asarray([name in what for name in table["run"]])
        assert len(set(table["run"][back])) == 1  # a quarter of six
    else:
        name, value = holdout.split("=")
        back = table[name] == (value if name == "run" else float(value))
    columns = dict(table.columns)
    for name in ("torque_Nm", "drawbar_pull_N", "sinkage_m"):
        columns[name] = np.where(back, 1.7 * columns[name] + 0.01, columns[name])
    other = gap(case, replace(table, columns=columns), effects=FEW, holdout=holdout, seed=3)
    assert answers(other) == answers(report)
    key = "held_out_runs" if holdout == "run" else "held_out_region"
    assert other.gap[key].after > 2.0 * report.gap[key].after
    assert report.gap[key].readings == 3 * back.sum()


def test_held_out_rows_without_known_noise_are_ignored(dug):
    table = dug[1]
    quiet = case_of(MODEL.replace('torque_Nm = "1 %"\n', ""))
    std = np.where(table["run"] == "run_3", np.nan, 0.01 * np.abs(table["torque_Nm"]))
    table = replace(table, columns=table.columns | {"torque_Nm_std": std})
    region = gap(quiet, table, effects=FEW, holdout="run=run_3").gap["held_out_region"]
    assert region.after < 5.0


def test_rows_with_another_status_than_ok_are_excluded(dug, report):
    (case, table), plain = dug, report.as_json()
    status = np.asarray(["ok"] * len(table), dtype="<U30")
    more = {n: np.append(v, v[3]) for n, v in table.columns.items()} | {
        "status": np.append(status, "no equilibrium"),
    }
    more["torque_Nm"][-1] *= 3.0
    found = gap(case, replace(table, columns=more), effects=FEW).as_json()
    assert [note["code"] for note in found.pop("notes")] == ["rows-excluded"]
    assert plain.pop("notes") == []
    assert found == plain


def test_a_calibrated_sensor_is_not_named():
    """A gain of 10 % that a check rules out at 0.3 % is not what is named."""
    case = case_of()
    table = driven(case, [EFFECTS["torque-gain"](gain=0.1)], slips=6, seed=4)
    free = gap(case, table, effects=FEW)
    assert ("torque-gain",) in free.cause_set
    checked = gap(case, table, effects=FEW, calibration={"torque-gain": 0.003})
    assert ("torque-gain",) not in checked.cause_set


@pytest.fixture(scope="module")
def model(dug, report, tmp_path_factory):
    """The grown model as a file, and the runs beside it."""
    folder, table = tmp_path_factory.mktemp("grown"), dug[1]
    assert report.status == "named"
    (folder / "model.toml").write_text(case_as_toml(report.model, [report.sentence]))
    names = list(table.columns)
    rows = [",".join(str(table[n][i]) for n in names) for i in range(len(table))]
    (folder / "runs.csv").write_text("\n".join([",".join(names), *rows]) + "\n")
    return folder


def test_the_updated_model_can_be_identified_and_simulated(model, capsys):
    file = str(model / "model.toml")
    assert main(["identify", file, str(model / "runs.csv")]) == 0
    assert main(["simulate", file, "--slip", "0.1,0.5", "--load", "60", "--format", "csv"]) == 0
    assert ",ok" in capsys.readouterr().out


def test_the_updated_model_makes_a_recipe(model, capsys):
    text = "rows = 64\nseed = 1\n" + (model / "model.toml").read_text()
    text += "[operating]\nslip = [0.05, 0.6]\nload_N = [30.0, 120.0]\n"
    (model / "recipe.toml").write_text(text)
    assert main(["generate", str(model / "recipe.toml"), str(model / "data.parquet")]) == 0
    assert (model / "data.parquet").stat().st_size > 0


@pytest.mark.parametrize("before", ["", "import soilml.gap\n", "from soilml.gap import audit\n"])
def test_the_package_and_its_function_are_called_alike(before):
    """`from soilml import gap` gives the module where that was imported first."""
    code = f"{before}from soilml import gap\nfrom soilml.gap import gap as function\n"
    code += "import soilml, soilml.gap as module\n"
    code += "assert soilml.gap is module and module.gap is function\n"
    code += "for called in (gap, soilml.gap, function):\n"
    code += "    try:\n        called(None, {}, effects={})\n"
    code += "    except (soilml.SoilmlError, AttributeError) as error:\n        print(error)\n"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    first, second, third = done.stdout.splitlines()
    assert first == second == third
