"""Figures of held-out rows, of other laws and of few rows; records that are kept and taken up."""

import json
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "bench"))

import gap
import gap_families
import gap_held_out

from datagen.blind_sets.plans import benchmark_plans

METHODS = dict.fromkeys(gap_held_out.METHODS, 4.0)


def record(**changed):
    """A set in which slip-sinkage was hidden and named."""
    return {
        "tier": "A",
        "cause": "slip-sinkage",
        "design": "sweep",
        "discrepancy": 0.0,
        "truth": ("slip-sinkage",),
        "relatives": [],
        "catalogued": True,
        "rows": 64,
        "signal": 20.0,
        "snr": 10.0,
        "status": "named",
        "cause_set": [("slip-sinkage",)],
        "suspects": [],
        "probabilities": {},
        "gap": {"train": (10.0, 1.0)},
        "beside_remainder": {},
        "between": METHODS | {"named": 1.0, "process of readings": 2.0},
        "region": METHODS | {"named": 2.0},
    } | changed


def figure(found, start):
    """The one figure whose name starts so."""
    (one,) = [f for f in found if f.name.startswith(start)]
    return one


def test_predictions_are_compared_where_the_soil_alone_leaves_something():
    sets = [record() for _ in range(3)]
    sets += [record(between=METHODS | {"soil": 0.5, "named": 5.0})]  # nothing left to improve
    found = list(gap_held_out.figures(sets))
    assert figure(found, "held out between, returned model over soil alone: median").met
    assert figure(found, "held out between, returned model over soil alone: worst").met
    process = figure(found, "held out between, over a Gaussian process alone, discrepancy 0%")
    assert process.measured.startswith("0.500 (3 sets)") and process.met
    assert figure(
        found, "heavier loads, returned model over soil alone: median"
    ).measured.startswith("0.500 (4 sets)")
    worse = [*sets, record(between=METHODS | {"named": 6.0})]
    found = list(gap_held_out.figures(worse))
    assert not figure(found, "held out between, returned model over soil alone: worst").met
    assert figure(found, "held out between, worse than").measured.endswith("1/4")
    none = figure(found, "held out between, over a Gaussian process alone, discrepancy 4%")
    assert none.met is None and none.measured == "-"


def law(**changed):
    """A set whose shear law is a hyperbola."""
    hidden = {"tier": "L", "cause": "hyperbolic-shear", "truth": ("hyperbolic-shear",)}
    family = ["hyperbolic-shear", "shear-softening"]
    return record(**(hidden | {"relatives": family, "cause_set": [("shear-softening",)]} | changed))


def test_a_law_of_the_same_family_is_right_and_any_other_is_false():
    found = list(gap_families.figures([law(), law(cause_set=[("hyperbolic-shear",)])]))
    assert figure(found, "a law differs").measured.endswith("2/2")
    assert figure(found, "falsely unique: another law").met
    wrong = law(cause_set=[("slip-sinkage",)])
    several = law(status="class", cause_set=[("slip-sinkage",), ("shear-softening",)])
    found = list(gap_families.figures([law(), wrong, several]))
    assert figure(found, "a law differs").measured.endswith("1/3")
    assert figure(found, "falsely unique: another law").measured.endswith("1/3")
    mixed = law(cause_set=[("shear-softening", "slip-sinkage")])
    assert figure(gap_families.figures([mixed]), "falsely unique: another").measured.endswith("1/1")


def test_records_of_the_same_state_are_not_made_again(tmp_path, monkeypatch):
    plans = benchmark_plans(0)[:3]
    made = []

    def judge(job):
        made.append(job[0])
        return gap.asdict(job[1]) | record() | gap.asdict(job[1]) | {"truth": ["slip-sinkage"]}

    monkeypatch.setattr(gap, "judged", judge)
    file = str(tmp_path / "kept.json")
    first = gap._judge(plans[:2], (), 1, file)
    assert made == [0, 1] and [s["seed"] for s in first] == [p.seed for p in plans[:2]]
    again = gap._judge(plans, (), 1, file)
    assert made == [0, 1, 2] and [s["seed"] for s in again] == [p.seed for p in plans]
    assert gap._key(again[0]) == gap._key(first[0])
    assert again[0]["truth"] == ("slip-sinkage",)
    monkeypatch.setattr(gap, "source_state", lambda: "another")
    gap._judge(plans[:1], (), 1, file)
    assert made == [0, 1, 2, 0]
    assert {s["state"] for s in json.loads(Path(file).read_text())} >= {"another"}


def heavier(**distances):
    """A record of the comparison of rows kept back."""
    usual = {"soil": 4.0, "effect": 2.0, "hybrid": 2.0, "process": 8.0}
    usual |= {"soil + process": 3.0}
    return {"discrepancy": 0.02, "kept": usual, "heavier": usual | distances}
