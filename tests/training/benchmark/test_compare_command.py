"""`soilml compare` on the fixed benchmark."""

import csv
import json

import pytest

from soilml.cli import main
from training.benchmark.bayes_limit import UNMODELLED_EFFECTS
from training.benchmark.methods import (
    ANALYTIC_PREFIX,
)
from training.benchmark.suite import (
    ANALYTIC_METHODS,
    LIMIT_LABEL,
    POSTERIOR_LABEL,
)


@pytest.mark.long
def test_the_command_writes_tables_figure_and_goals(small_model, tmp_path, capsys):
    out = tmp_path / "results"
    assert main(["compare", str(small_model), "--sets", "1", "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    assert "18 rows, three loads, slips in a grid" in printed and "Bayes limit" in printed
    rows = list(csv.DictReader((out / "benchmark.csv").read_text().splitlines()))
    assert {r["method"] for r in rows} == {
        LIMIT_LABEL,
        POSTERIOR_LABEL,
        "prior",
        "small",
        *(f"{ANALYTIC_PREFIX}{name}" for name in ANALYTIC_METHODS),
    }
    assert {r["unknown_effect"] for r in rows} == {"", *UNMODELLED_EFFECTS}
    assert (out / "benchmark.png").stat().st_size > 20_000
    assert "Acceptance goals" in (out / "report.html").read_text()
    content = json.loads((out / "benchmark.json").read_text())
    assert content["report"]["answer"][0].endswith("acceptance goals are met.")
    assert max(map(len, printed.splitlines())) <= 100
