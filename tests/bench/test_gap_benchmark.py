"""The benchmark of the gap workflow: how records are judged, and what the runs of a set show."""

import json
import sys
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

from datagen.blind_sets import Plan

sys.path.insert(0, str(Path(__file__).parents[2] / "bench"))

import gap_bench
import gap_figures
import gap_reliability
import gap_tables
from runner import plain


def record(**changed):
    """A set in which slip-sinkage was hidden and named."""
    return {
        "tier": "A",
        "design": "sweep",
        "discrepancy": 0.0,
        "truth": ["slip-sinkage"],
        "catalogued": True,
        "rows": 64,
        "signal": 20.0,
        "snr": 10.0,
        "status": "named",
        "cause_set": [["slip-sinkage"]],
        "suspects": [],
        "probabilities": {"slip-sinkage": 0.99, "grousers": 0.01},
        "seconds": 0.5,
        "solves": 500_000.0,
        "soil": {"cohesion": {"before": 500.0, "after": 810.0, "std": 10.0, "true": 800.0}},
        "region": {"soil": 10.0, "named": 2.0, "Gaussian process": 5.0},
    } | changed


def null(**changed):
    """A set in which nothing was hidden and nothing was found."""
    empty = {"tier": "N0", "truth": [], "catalogued": False, "signal": 0.0, "snr": 0.0}
    empty |= {"status": "no-gap", "cause_set": [], "probabilities": {"grousers": 0.01}}
    return record(**(empty | changed))


def figure(sets, start):
    """The one figure whose name starts so."""
    (found,) = [f for f in gap_figures.figures(sets) if f.name.startswith(start)]
    return found


def test_the_right_cause_counts_where_the_runs_can_name_it():
    sets = [record() for _ in range(19)]
    sets += [record(snr=1.0, cause_set=[["grousers"]]) for _ in range(5)]  # too weak to count
    sets += [record(design="one-load", cause_set=[]) for _ in range(5)]  # judged by suspects
    name = "right cause in the cause set, SNR >= 3, discrepancy 0%"
    assert figure(sets, name).met and "19/19" in figure(sets, name).measured
    sets += [record(status="unknown", cause_set=[]), record(status="unknown", cause_set=[])]
    assert not figure(sets, name).met and "19/21" in figure(sets, name).measured
    assert figure(sets, "`unknown`").measured.endswith("2/26")
    assert not figure(sets, "`unknown`").met and figure(sets, "`no-gap`").met
    assert figure(sets, name.replace("0%", "1%")).met is None


def test_names_where_nothing_was_hidden_are_false():
    named = {"status": "named", "cause_set": [["grousers"]]}
    sets = [null() for _ in range(30)] + [null(tier="D", discrepancy=0.02, **named)]
    sets += [null(design="unequal-soils"), null(tier="N1", **named)]
    sets += [null(tier="C", truth=["crust"], status="unknown"), null(tier="C", **named)]
    assert figure(sets, "falsely unique: null").measured.endswith("0/30")
    assert figure(sets, "falsely unique: null").met
    assert figure(sets, "falsely unique: scatter").measured.endswith("1/2")
    assert figure(sets, "falsely unique: discrepancy alone").measured.endswith("1/1")
    assert figure(sets, "falsely unique: cause outside").measured.endswith("1/2")
    assert not figure(sets, "falsely unique: cause outside").met
    assert figure(sets, "right when unique, all tiers").measured.endswith("0/3")


def test_probabilities_are_judged_by_their_calibration_and_by_what_chance_does():
    generator = np.random.default_rng(1)
    stated = np.sort(generator.random(3000) ** 2)
    exact, low = generator.random((2, 3000)) < [stated, np.sqrt(stated)]

    def sets(hidden):
        names = [f"e{i}" for i in range(10)]
        for p, t in zip(stated.reshape(300, 10), hidden.reshape(300, 10), strict=True):
            given = dict(zip(names, p.tolist(), strict=True))
            yield record(probabilities=given, truth=[n for n, h in zip(names, t, strict=True) if h])

    error, by_chance = gap_reliability.calibration_error(list(sets(exact)))
    assert error < 1.2 * by_chance
    worse, by_chance = gap_reliability.calibration_error(list(sets(low)))
    assert worse > 2.0 * by_chance
    name = "stated probabilities from 0.02"
    assert figure(list(sets(exact)), name).met and not figure(list(sets(low)), name).met
    assert np.isnan(gap_reliability.calibration_error([record()])[0])


@pytest.mark.slow
def test_a_set_is_analysed_and_compared_with_its_truth():
    plan = Plan("A", "slip-sinkage", 1.0, 0.02, 8, "dry-sand", 3, 7, discrepancy=0.01)
    found = gap_bench.judged(asdict(plan))
    assert found["truth"] == ["slip-sinkage"] and found["catalogued"] and found["rows"] == 64
    assert found["snr"] > 3.0 and found["seconds"] > 0.0 and found["status"] != "crash"
    assert set(found["soil"]) == {"cohesion", "friction_angle", "shear_modulus"}
    assert found["region"]["soil"] > found["region"]["named"] > 0.0 or not found["cause_set"]
    assert set(found["pull"]) == {"inside", "lighter", "heavier", "faster"}
    assert all(0.0 <= share <= 1.0 for share in found["pull"].values())
    assert json.loads(json.dumps(plain(found)))["cause_set"] == found["cause_set"]


METHODS = dict.fromkeys(("soil", "named", "Gaussian process", "process of readings"), 4.0)


def held(**changed):
    """A set with rows held out."""
    parts = {"between": METHODS | {"named": 1.0, "process of readings": 2.0}}
    parts |= {"region": METHODS | {"named": 2.0}, "gap": {"train": [10.0, 1.0]}}
    return record(cause="slip-sinkage", relatives=[], **(parts | changed))


def law(**changed):
    """A set whose shear law is a hyperbola."""
    hidden = {"tier": "L", "truth": ["hyperbolic-shear"], "cause_set": [["shear-softening"]]}
    family = {"relatives": ["hyperbolic-shear", "shear-softening"]}
    return held() | {"cause": "hyperbolic-shear"} | hidden | family | changed


def test_predictions_are_compared_where_the_soil_alone_leaves_something():
    sets = [held() for _ in range(3)]
    sets += [held(between=METHODS | {"soil": 0.5, "named": 5.0})]  # nothing left to improve
    over = "held out between, returned model over soil alone: "
    assert figure(sets, over + "median").met and figure(sets, over + "worst").met
    process = figure(sets, "held out between, over a Gaussian process alone, discrepancy 0%")
    assert process.measured.startswith("0.500 (3 sets)") and process.met
    worse = [*sets, held(between=METHODS | {"named": 6.0})]
    assert not figure(worse, over + "worst").met
    assert figure(worse, "held out between, worse than").measured.endswith("1/4")
    none = figure(sets, "held out between, over a Gaussian process alone, discrepancy 4%")
    assert none.met is None and none.measured == "-"


def test_a_law_of_the_same_family_is_right_and_any_other_is_false():
    wrong = law(cause_set=[["slip-sinkage"]])
    several = law(status="class", cause_set=[["slip-sinkage"], ["shear-softening"]])
    found = [law(), wrong, several]
    assert figure(found, "a law differs").measured.endswith("1/3")
    assert figure(found, "falsely unique: another law").measured.endswith("1/3")
    mixed = law(cause_set=[["shear-softening", "slip-sinkage"]])
    assert figure([mixed], "falsely unique: another").measured.endswith("1/1")
    assert gap_bench.relatives("C", "stiff-layer", ["stiff-layer"]) == ["firm-base"]
    assert gap_bench.relatives("T", "trend/friction", ["trend"]) == ["friction-drift"]
    assert "| L | 3 |" in gap_tables.tables(found)
