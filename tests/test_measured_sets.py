"""Published single-wheel tests as inputs of the gap workflow, and their page; needs no data."""

import importlib.util
import sys
import tomllib
from pathlib import Path

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


def report(status="suspected", *names):
    """The part of gap.json that the page reads."""
    suspects = [{"effects": [name], "log_odds": 1.0 - i} for i, name in enumerate(names)]
    return {
        "status": status,
        "suspects": suspects,
        "cause_set": [],
        "gap": {"train": {"before": 24.0, "after": 0.6}},
    }


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
