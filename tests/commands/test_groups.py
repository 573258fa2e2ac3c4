"""One answer for each run: runs that can have none, and rows that have no answer themselves."""

import json

import pytest
from conftest import MODEL
from console import refused, rows_printed

from soilml.cli import main

RUNS = """\
run,slip,load_N,torque_Nm,status
a,0.1,60,1.19,ok
a,0.3,80,3.54,ok
a,0.5,100,6.42,
b,0.2,60,,ok
c,0.1,60,1.19,ok
c,0.3,80,3.54,no equilibrium
"""


@pytest.fixture
def folder(workplace):
    (workplace / "model.toml").write_text(MODEL)
    (workplace / "runs.csv").write_text(RUNS)
    return workplace


@pytest.mark.slow
def test_a_run_that_cannot_be_identified_is_named_and_the_others_are_not_lost(folder, capsys):
    command = ["identify", "model.toml", "--by", "run", "--method", "posterior"]
    assert main([*command, "runs.csv", "--out", "o.json"]) == 0
    content = json.loads((folder / "o.json").read_text())
    assert set(content["runs"]) == {"a", "c"} and set(content["failed"]) == {"b"}
    assert content["runs"]["c"]["rows_used"] == 1
    assert "run b has no result" in capsys.readouterr().err
    (folder / "none.csv").write_text("run,slip,load_N,torque_Nm\nx,0.1,60,\ny,0.1,60,\n")
    words = [*command, "none.csv", "--out", "n.json"]
    refused(words, capsys, "run x: none.csv: no reading", folder)


@pytest.mark.slow
def test_all_runs_of_one_soil_are_one_set_of_readings(folder, capsys):
    """`--by all` gives what the same rows give as one run."""
    header, *rows = [line for line in RUNS.splitlines() if not line.startswith("b")]
    renamed = [header, *("x" + row[1:] for row in rows)]
    (folder / "one.csv").write_text("\n".join(renamed) + "\n")
    found = {}
    for table, by in (("runs.csv", "all"), ("one.csv", "run")):
        (found[by],) = rows_printed(["estimate", "wheel", table, "--by", by], capsys)
        assert found[by].pop(by) == {"all": "all", "run": "x"}[by]
    assert found["all"] == found["run"] and found["all"]["rows"] == "4"
