"""Published single-wheel tests as inputs of the gap workflow, and their page; needs no data."""

import importlib.util
import sys
import tomllib
from pathlib import Path

import pytest

from soilml.cli import main
from soilml.config.case import read_case
from soilml.io.read_table import read_table

HERE = Path(__file__).parents[1] / "examples" / "gap"


def module(name):
    spec = importlib.util.spec_from_file_location(name, HERE / f"{name}.py")
    loaded = importlib.util.module_from_spec(spec)
    sys.modules[name] = loaded
    spec.loader.exec_module(loaded)
    return loaded


real = module("real")
measured_sets = module("measured_sets")
SETS = {one.name: one for one in measured_sets.SETS}


@pytest.mark.parametrize("priors", measured_sets.PRIORS)
@pytest.mark.parametrize("name", SETS)
def test_every_model_file_is_read(name, priors, tmp_path):
    file = tmp_path / "model.toml"
    file.write_text(measured_sets.model_text(SETS[name], priors))
    case = read_case(file)
    assert case.prior and set(case.noise) == set(SETS[name].noise)
    assert bool(case.gears) == (len(SETS[name].wheels) > 1)


def test_wide_priors_contain_those_of_init_which_are_the_commands(tmp_path):
    written = tmp_path / "first.toml"
    assert main(["init", str(written), "--radius", "0.1", "--width", "0.1"]) == 0
    own = tmp_path / "own.toml"
    own.write_text(measured_sets.model_text(SETS["ding2011_smooth"], "init"))
    wide = tmp_path / "wide.toml"
    wide.write_text(measured_sets.model_text(SETS["ding2011_smooth"], "wide"))
    init, other, largest = (read_case(f).prior for f in (written, own, wide))
    assert {n: (p.lower, p.upper) for n, p in init.items()} == {
        n: (p.lower, p.upper) for n, p in other.items()
    }
    assert all(largest[n].lower <= p.lower < p.upper <= largest[n].upper for n, p in init.items())


def test_rows_of_the_set_are_taken_and_named(tmp_path):
    folder = tmp_path / "ding2011"
    folder.mkdir()
    head = "case_id,grouser_height_m,vertical_load_n,slip,"
    head += "meas_torque_nm,meas_drawbar_pull_n,meas_sinkage_m\n"
    rows = ["x_smooth_a,0.0,80,0.0,0,-6,0.005", "x_smooth_b,0.0,80,0.1,3,11,0.006"]
    rows += ["x_lug10_c,0.01,80,0.1,4,14,0.005", "x_smooth_d,0.0,80,0.1,3,11,0.006"]
    (folder / "single_wheel_tests.csv").write_text(head + "\n".join(rows) + "\n")
    file = tmp_path / "runs.csv"
    file.write_text(measured_sets.table_text(SETS["ding2011_both"], tmp_path))
    table = read_table(file, ("run", "slip", "load_N", "gear"))
    assert list(table["run"]) == ["smooth_1", "lug10_1", "smooth_2"]  # not the row at zero slip
    assert list(table["gear"]) == ["smooth", "lugged", "smooth"]
    assert list(table["torque_Nm"]) == [3.0, 4.0, 3.0]
    assert list(table["sinkage_m"]) == [0.006, 0.005, 0.006]


def report(status="suspected", *names):
    """The part of gap.json that the page reads."""
    suspects = [{"effects": [name], "log_odds": 1.0 - i} for i, name in enumerate(names)]
    return {
        "status": status,
        "suspects": suspects,
        "cause_set": [],
        "gap": {"train": {"before": 24.0, "after": 0.6}},
    }


def test_a_verdict_survives_where_all_priors_give_the_same_first_explanation():
    assert real._survives(["slip-sinkage"] * 3, [1.0, -1.0, -2.0]) == "yes"
    assert real._survives(["slip-sinkage", "slip-sinkage", ""], [0.1, -1.0, None]) == "**no**"
    assert real._survives(["slip-sinkage", "slope", ""], [-0.1, -1.0, None]) == "undecided"
    assert real._survives(["", "", ""], [None, None, None]) == "no cause"
    assert real.first_of(report("suspected", "slip-sinkage", "slope")) == "slip-sinkage"
    assert real.first_of({"status": "crash"}) == ""
    named = report("named", "slope") | {"cause_set": [["grousers", "exit-angle"]]}
    assert real.first_of(named) == "grousers + exit-angle"


#: Errors of kept slips, all of them between others.
KEPT = {"between": {"soil alone": 4.0, "returned model": 1.0, "process": 2.0}}


def test_the_page_has_the_reports_figures_and_a_belief_for_every_set():
    beliefs = tomllib.loads((HERE / "beliefs.toml").read_text())
    assert set(beliefs) == set(SETS)
    found = {
        name: {p: report("suspected", "slip-sinkage", "slope") for p in real.PRIORS}
        for name in SETS
    }
    found["kls1_both"]["wide"] = {"status": "bad-data"}
    kept = dict.fromkeys(SETS, KEPT) | {"rashid1": {}}
    text = real.page(list(SETS.values()), found, kept)
    title = SETS["ding2011_smooth"].title
    assert f"| {title} | 4.00 | 1.00 | 2.00 | - | - | - |" in text
    assert SETS["rashid1"].title not in text.partition("ends: process")[2].partition("## ")[0]
    count = len(SETS) - 1
    assert f"over the soil alone: nearer to the readings in {count} of {count} sets" in text
    assert "errors 0.25 times as large in the median, 0.25 times in the worst set" in text
    assert f"in {len(SETS) - 1} of {len(SETS)} sets" in text
    assert "slip-sinkage (2.7 to 1); slope (1 to 1)" in text and "24 -> 0.6" in text
    assert "| wide | `bad-data` | - | - | - |" in text
    for name, words in beliefs.items():
        assert words[:60] in text, name
