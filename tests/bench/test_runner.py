"""The runner of benches: a case gives a record gives a table, and an ended run goes on."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "bench"))

import runner
from runner import ROOT, Bench, Sample, each, main, rows_of, table


def bench(measure, **changed):
    """Squares of two seeds in two worlds."""

    def cases(sample):
        return [{"world": w, "seed": s} for w in ("flat", "steep") for s in sample.of((3, 4))]

    def tables(rows):
        columns = {"mean": each("values", ".1f"), "sets": len}
        return table(rows, {"ground": "world"}, columns, over_all="all")

    return Bench("squares", "Squares", "Of seeds.", cases, measure, tables, **changed)


def squared(case):
    sign = -1.0 if case["world"] == "steep" else 1.0
    return [{"values": sign * np.asarray([case["seed"], case["seed"] ** 2])} for _ in range(2)]


@pytest.fixture
def folders(tmp_path, monkeypatch):
    """Folders of results and of runs that have not ended."""
    monkeypatch.setattr(runner, "RESULTS", tmp_path / "results")
    monkeypatch.setattr(runner, "UNFINISHED", tmp_path / "unfinished")
    monkeypatch.setattr(runner.run, "__defaults__", (None, tmp_path / "unfinished"))
    monkeypatch.setattr(runner.write, "__defaults__", (tmp_path / "results",))
    monkeypatch.setattr(runner.render, "__defaults__", (tmp_path / "results",))
    (tmp_path / "results").mkdir()
    return tmp_path


def test_cases_give_records_and_a_table_by_groups(folders):
    own = bench(squared)
    rows = rows_of(runner.run(own, own.cases(Sample()), workers=2))
    assert len(rows) == 8 and rows[0] == {"world": "flat", "seed": 3, "values": [3.0, 9.0]}
    lines = own.tables(rows).splitlines()
    assert lines[0] == "| ground | mean | sets |" and lines[1] == "| --- | ---: | ---: |"
    assert lines[2] == "| flat | 3.5 / 12.5 | 4 |" and lines[3] == "| steep | -3.5 / -12.5 | 4 |"
    assert lines[4] == "| all | 0.0 / 0.0 | 8 |"


def test_a_whole_run_is_written_and_its_tables_again_from_the_records(folders, capsys):
    main([bench(squared)], ["squares", "--workers", "1"])
    kept = json.loads((folders / "results/squares.json").read_text())
    assert kept["command"] == "python bench/run.py squares" and len(kept["records"]) == 4
    assert {"date", "version", "machine"} < kept.keys()
    page = (folders / "results/squares.md").read_text()
    assert page.startswith("# Squares\n\n**Measured** by `python bench/run.py squares` on ")
    assert "| flat | 3.5 / 12.5 | 4 |" in page
    assert not list((folders / "unfinished").iterdir())
    (folders / "results/squares.md").unlink()
    main([bench(squared)], ["squares", "--tables"])
    assert (folders / "results/squares.md").read_text() == page
    capsys.readouterr()


@pytest.mark.parametrize("words", [["--quick"], ["--seeds", "3"], ["--only", "world=flat"]])
def test_a_part_is_printed_and_not_written(folders, words, capsys):
    main([bench(squared)], ["squares", "--workers", "1", *words])
    said = capsys.readouterr().out
    assert ("steep" in said) is ("--only" not in words) and "| flat |" in said
    assert not list((folders / "results").iterdir())


def test_an_ended_run_goes_on_where_it_stopped(folders, monkeypatch):
    made = []

    def fails(case):
        made.append((case["world"], case["seed"]))
        if len(made) == 3:
            raise KeyboardInterrupt
        return squared(case)

    own = bench(fails)
    with pytest.raises(KeyboardInterrupt):
        runner.run(own, own.cases(Sample()), workers=1)
    file = folders / "unfinished/squares.jsonl"
    file.write_text(file.read_text() + '{"state": "cut o')  # a run that was killed while it wrote
    found = runner.run(own, own.cases(Sample()), workers=1)
    assert made == [("flat", 3), ("flat", 4), ("steep", 3), ("steep", 3), ("steep", 4)]
    assert found == runner.run(bench(squared), own.cases(Sample()), workers=1)
    monkeypatch.setattr(runner, "source_state", lambda: "another")
    runner.run(own, own.cases(Sample())[:1], workers=1)
    assert made[5:] == [("flat", 3)]


def test_the_results_of_the_repository_fill_the_page_of_validation():
    import validation

    blocks = (validation.gap_table, validation.sets_table, validation.worlds_table)
    blocks += (validation.faults_line, validation.adapt_line, validation.drives_table)
    said = " ".join(block() for block in (*blocks, validation.speed_table))
    page = (ROOT / "docs/validation.md").read_text()
    assert all(word in page for word in said.split())
