"""Figures of held-out rows, of other laws and of few rows; records that are kept and taken up."""

import json
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "bench"))

import gap
import gap_case
import gap_families
import gap_held_out
import gap_hybrid
import gap_pages
import gap_table

from datagen.blind_sets.plans import Plan, benchmark_plans

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


def test_a_figure_that_grows_is_counted_wherever_it_is_shown():
    calm = gap_held_out.figures([record(), record(gap={"train": (1.0, 1.0)})])
    assert figure(calm, "figures that grow").met
    grown = [record(gap={"train": (10.0, 1.0), "held_out_runs": (6.0, 12.3)})]
    assert figure(gap_held_out.figures(grown), "figures that grow").measured.endswith("1/2")
    beside = [record(beside_remainder={"held_out_runs": (6.0, 7.0)})]
    assert not figure(gap_held_out.figures(beside), "figures that grow").met


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


def test_a_firm_base_is_a_right_name_of_a_stiff_layer():
    relatives = gap_case._relatives("C", "stiff-layer", ("stiff-layer",))
    assert relatives == ["firm-base"] and gap_case._relatives("C", "crust", ("crust",)) == []
    assert gap_case._relatives("T", "trend/friction", ("trend",)) == ["friction-drift"]
    layer = record(tier="C", truth=("stiff-layer",), catalogued=False, relatives=relatives)
    sets = [layer | {"cause_set": [(name,)]} for name in ("firm-base", "slope")]
    found = list(gap_families.figures(sets))
    assert figure(found, "falsely unique: tiers L, T and C").measured.endswith("1/2")
    assert figure(gap_table.figures(sets), "falsely unique: cause outside").measured.endswith("1/2")
    assert "A stiff layer of tier C counts as named rightly" in gap_pages.text(sets, [])


def test_few_rows_and_torque_alone_have_figures_of_their_own():
    order = [("grousers",), ("slip-sinkage",)]
    few = record(design="few-rows", status="suspected", cause_set=[], suspects=order)
    found = list(gap_families.figures([few, few | {"suspects": order[::-1]}, few | {"snr": 1.0}]))
    assert figure(found, "5 to 10 rows at one load, SNR >= 3: truth first").measured.endswith("1/2")
    three = figure(found, "5 to 10 rows at one load, SNR >= 3: truth in the first three")
    assert three.met and three.measured.endswith("2/2")
    more = few | {"suspects": order, "added_to": "few-rows"}
    found = list(gap_families.figures([few, more, law(added_to="few-rows")]))
    assert figure(found, "5 to 10 rows at one load, SNR >= 3: truth first").measured.endswith("0/2")
    assert figure(found, "5 to 10 rows, signature of 6 sigma: truth first").measured.endswith("0/1")
    assert figure(found, "a law differs").measured == "-"
    torque = {"design": "torque-alone", "cause_set": [], "status": "no-gap"}
    sets = [record(**torque), record(**torque, signal=1.0), record(design="torque-alone")]
    found = list(gap_families.figures(sets))
    assert figure(found, "torque alone, signature").measured.endswith("1/2")
    page = gap_pages.text([few, law(), *sets], [record()])
    assert "| before |" in page and "## Other laws" in page and "## Held-out rows" in page
    usual = page.split("right cause in the cause set, SNR >= 3, discrepancy 0%")[1]
    assert usual.split("|")[2].strip() == "-"  # none of these sets is of the usual kind


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


def test_a_sample_has_every_discrepancy_of_the_causes_of_a_tier():
    sample = gap.thinned(benchmark_plans(0), 4)
    assert len(sample) == pytest.approx(len(benchmark_plans(0)) / 4, abs=1)
    for tier in "ABCS":
        levels = {p.discrepancy for p in sample if p.tier == tier and p.design == "sweep"}
        assert levels == {0.0, 0.01, 0.02, 0.04}
    assert gap.thinned(list("abcdefghi"), 3) == ["a", "e", "i"]
    assert gap.thinned(list("abc"), 1) == ["a", "b", "c"]


def heavier(**distances):
    """A record of the comparison of rows kept back."""
    usual = {"soil": 4.0, "effect": 2.0, "hybrid": 2.0, "process": 8.0}
    usual |= {"soil + process": 3.0}
    return {"discrepancy": 0.02, "kept": usual, "heavier": usual | distances}


def test_how_often_a_model_is_no_worse_than_the_better_of_two_is_said():
    sets = [heavier(), heavier(hybrid=2.4), heavier(hybrid=9.0, process=2.0)]
    said = gap_hybrid.kept_promise(sets)
    words = "The hybrid is no worse in 33%, at most 5% worse in 33%, at most 25% worse in 67%."
    assert words in said
    assert "The better one is 0.25 times" in said
    assert gap_hybrid.text(sets).endswith(said)


def test_a_plan_is_told_from_every_other():
    plan = benchmark_plans(0)[0]
    other = Plan(**{**gap.asdict(plan), "seed": plan.seed + 1})
    assert gap._key(gap.asdict(plan)) != gap._key(gap.asdict(other))
    with pytest.raises(KeyError):
        gap._key({"tier": "A"})


def test_a_page_names_the_command_that_made_its_records(monkeypatch):
    def said(*words):
        monkeypatch.setattr(sys, "argv", ["bench/gap.py", *words])
        return gap._command(gap._arguments())

    assert (
        said("--every", "3", "--enlarge", "60", "--write", "--keep", "a.json") == "`make bench-gap`"
    )
    other = said("--every", "30", "--tier", "L", "--seed", "1", "2")
    assert other == "`python bench/gap.py --every 30 --seed 1 2 --tier L --write`"
    assert "Written by another: 1 sets" in gap_pages.text([record()], (), "another")
