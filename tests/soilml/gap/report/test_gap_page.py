"""The page contains the report, is self-contained, and escapes all text."""

import base64
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from soilml import Model, Wheel, soil
from soilml.config.case import Case
from soilml.gap.checks import MIN_RESIDUAL_READINGS, NAMING_RESIDUAL_READINGS
from soilml.gap.report.page import page
from soilml.gap.report.prediction_curves import MOST_RUNS, select_runs
from soilml.gap.report.results import (
    STATUSES,
    CandidateSummary,
    EstimatedValue,
    GapReduction,
    GapReport,
    NamedEffect,
    NextRun,
    ReadingsAndPredictions,
    RegionScore,
    RemainingDiscrepancy,
    Suspect,
)
from soilml.physics.effects import EFFECTS
from soilml.remarks import Remark

pytest.importorskip("jinja2")
pytest.importorskip("matplotlib")

VOID = {"meta", "link", "br", "img", "hr", "input"}
EVIL = '<script>alert("x")</script>&\'$\\frac{'


def said(text):
    """A remark with this text."""
    return Remark("some-code", text)


class Checked(HTMLParser):
    """Tags that open and close in order, ids that occur once, attributes that fetch something."""

    def __init__(self):
        super().__init__()
        self.open, self.ids, self.fetched, self.tags, self.text = [], [], [], [], []
        self.targets = []

    def handle_starttag(self, tag, attrs):
        self.note(tag, attrs)
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.note(tag, attrs)

    def note(self, tag, attrs):
        self.tags.append(tag)
        for key, value in attrs:
            if key == "id":
                self.ids.append(value)
            if key in ("src", "href", "srcset", "data", "action", "xlink:href"):
                self.fetched.append(value)
            self.targets += re.findall(r"url\(([^)]*)\)", value or "")
            assert not key.startswith("on"), key

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)


def read(html):
    seen = Checked()
    seen.feed(html)
    seen.close()
    assert seen.open == []
    return seen


def figures(seen):
    """The SVG text of the embedded figures."""
    head = "data:image/svg+xml;base64,"
    return [base64.b64decode(s[len(head) :]).decode() for s in seen.fetched if s.startswith(head)]


def curves(runs=8, channels=("torque_Nm", "drawbar_pull_N", "sinkage_m"), slips=5):
    rng = np.random.default_rng(0)
    run, slip, channel = np.meshgrid(
        np.arange(runs), np.linspace(0.05, 0.6, slips), np.arange(len(channels)), indexing="ij"
    )
    run, slip, channel = run.ravel(), slip.ravel(), channel.ravel()
    load = 40.0 + 10.0 * run
    true = load * slip
    return ReadingsAndPredictions(
        channels=channels,
        channel=channel,
        run=tuple(f"r{i}" for i in run),
        slip=slip,
        load=load,
        measured=true + 0.1 * rng.standard_normal(true.size),
        std=np.full(true.size, 0.1),
        before=0.9 * true,
        after=true,
        after_std=np.full(true.size, 0.05),
    )


def report(status="named", **changes):
    wheel = Model(Wheel(radius=0.15, width=0.12))
    case = Case(wheel + EFFECTS["slip-sinkage"](n1=0.4), soil("wong1989/dry_sand"))
    channels = {"torque_Nm": (55.2, 1.11), "drawbar_pull_N": (26.8, 1.06), "sinkage_m": (879, 0.83)}
    reduction = GapReduction(320.2, 1.0017, channels, 192, "all rows fitted")
    n1 = {"n1": EstimatedValue(0.40134, 0.00147, "1")}
    whole = GapReport(
        status=status,
        sentence="The gap is explained by slip-sinkage: mean squared residual 320 -> 1.00 "
        "(noise alone gives 1).",
        model=case,
        effects=(NamedEffect("slip-sinkage", n1, (), 184.3, "exit-angle", 0.9991, 7.0),),
        cause_set=(("slip-sinkage",), ("grousers", "bulldozing")),
        where=(
            RegionScore("sinkage_m", (0.4, 0.6), (40.0, 80.0), 122.9, 0.0002),
            RegionScore("torque_Nm", (0.1, 0.3), (80.0, 150.0), 2.1, 0.4),
        ),
        gap={
            "train": reduction,
            "held_out_runs": replace(
                reduction, description="every run predicted by fits to the others"
            ),
            "held_out_region": replace(
                reduction, description="load_N >= 150, predicted from the rest"
            ),
        },
        soil_before={
            "friction_angle": EstimatedValue(0.404, 0.0013, "rad"),
            "kc": EstimatedValue(0.0, 0.0, "Pa"),
        },
        soil_after={
            "friction_angle": EstimatedValue(0.47694, 0.0013, "rad"),
            "kc": EstimatedValue(9.0, 1.0, "Pa"),
        },
        mimic_radius=0.62,
        next_runs=(NextRun("reverse", "the same run driven the other way", 7.25, ()),),
        candidates=(
            CandidateSummary(("slip-sinkage",), 61202.8, 61284.0, 0.0, said("explains the data")),
            CandidateSummary(
                ("grousers", "bulldozing"), float("nan"), 7.0, 9.0, said("more effects than needed")
            ),
        ),
        untestable={"rate": said("needs speed_m_s")},
        notes=(said("the noise of sinkage_m is 1.3 times as large as declared"),),
        not_claimed=(said("that a smaller gap proves a cause"),),
        variance_components={
            "noise_scale_torque_Nm": 0.87,
            "friction_angle_std": 0.00698,
        },
        suspects=(Suspect(("slip-sinkage",), 7.0, 0.9),),
        conditions=(Remark("one-bed", "the bed was the same for all rows"),),
        discrepancy={
            "torque_Nm": RemainingDiscrepancy(
                "N m", 0.404, 0.137, 2.3, 1.6, "measured below the model, at slip 0.14 under 71 N"
            )
        },
        gap_probability=0.9998,
        remainder_probability=0.14,
        seed=7,
        curves=curves(),
    )
    return replace(whole, **changes)


def bad():
    return GapReport("bad-data", "no noise; one channel", report().model)


@pytest.mark.slow
@pytest.mark.parametrize("status", STATUSES)
def test_every_status_gives_a_complete_page_with_its_meaning(status):
    # the picture of the curves is the same for all; it takes most of the time
    drawn = {} if status == "named" else {"curves": None}
    html = page(
        bad() if status == "bad-data" else report(status, **drawn), "rover.toml", "runs.csv"
    )
    seen = read(html)
    assert html.startswith("<!DOCTYPE html>\n<html lang=")
    assert len(set(seen.ids)) == len(seen.ids)
    text = " ".join(seen.text)
    assert STATUSES[status] in text
    assert "What to do" in text
    assert seen.tags.count("h1") == 1
    assert seen.tags.count("caption") == seen.tags.count("table")


def test_the_page_on_bad_data_says_how_many_readings_the_checks_ask_for():
    text = " ".join(read(page(bad(), "rover.toml", "runs.csv")).text)
    assert f"at least {MIN_RESIDUAL_READINGS} readings more than free soil parameters" in text
    assert f"to name a cause: at least {NAMING_RESIDUAL_READINGS} readings more" in text


@pytest.mark.slow
@pytest.mark.parametrize("whole", [report(), bad()])
def test_the_page_is_self_contained(whole):
    html = page(whole, "rover.toml", "runs.csv")
    seen = read(html)
    assert not {"script", "iframe", "object", "embed"} & set(seen.tags)
    known = {f"#{name}" for name in seen.ids}
    fetched = {source for source in seen.fetched if not source.startswith("data:image/svg+xml;")}
    assert fetched <= known | {"data:,"}
    assert set(seen.targets) <= known
    assert len(figures(seen)) == seen.tags.count("img")
    for svg in figures(seen):
        assert "<script" not in svg and "<image" not in svg
        assert all(link.startswith("#") for link in re.findall(r'href="([^"]*)"', svg))
    assert "http:" not in html and "https:" not in html and "@import" not in html


@pytest.mark.slow
def test_hostile_names_stay_text():
    c = curves()
    whole = report(
        sentence=EVIL,
        conditions=(said(EVIL),),
        notes=(said(EVIL),),
        not_claimed=(said(EVIL),),
        untestable={EVIL: said(EVIL)},
        suspects=(Suspect((EVIL,), 0.0, 0.45),),
        discrepancy={EVIL: RemainingDiscrepancy(EVIL, 2.0, 1.0, 2.0, 1.0, EVIL)},
        variance_components={EVIL: 1.0},
        cause_set=((EVIL,),),
        effects=(
            NamedEffect(EVIL, {EVIL: EstimatedValue(1.0, 0.1, EVIL)}, (EVIL,), 1.0, EVIL, 0.5, 0.0),
        ),
        where=(RegionScore(EVIL, (0.1, 0.2), (1.0, 2.0), 5.0, 0.01),),
        candidates=(CandidateSummary((EVIL,), 1.0, 1.0, 0.0, said(EVIL)),),
        next_runs=(NextRun(EVIL, EVIL, 1.0, ()),),
        soil_before={EVIL: EstimatedValue(1.0, 0.1, EVIL)},
        gap={EVIL: GapReduction(2.0, 1.0, {EVIL: (2.0, 1.0)}, 9, EVIL)},
        curves=replace(c, run=tuple(EVIL + r for r in c.run), channels=(EVIL, *c.channels[1:])),
    )
    html = page(whole, EVIL, EVIL)
    seen = read(html)
    assert "<script" not in html
    assert "script" not in seen.tags
    assert EVIL in "".join(seen.text)


@pytest.mark.slow
def test_the_same_report_gives_the_same_bytes():
    assert page(report(), "rover.toml", "runs.csv") == page(report(), "rover.toml", "runs.csv")


@pytest.mark.slow
def test_the_page_contains_the_figures_of_the_report():
    seen = read(page(report(), "rover.toml", "runs.csv"))
    text = " ".join(" ".join([*seen.text, *figures(seen)]).split())
    for figure in (
        *("320", "1.00", "879", "0.830"),  # the gap, before and after
        "mean squared residual 320 → 1.00 (noise alone gives 1)",
        "0.4013 ± 0.0015",  # the effect
        *("23.147 ± 0.074", "27.327 ± 0.074", "+4.179°", "0.4040 ± 0.0013 rad"),  # the soil
        *("61203", "61284", "more effects than needed"),
        "7.25 σ",
        "a smooth discrepancy is left beside this explanation: 0.14",
        *("0.137 N m", "1.60", "at slip 0.14 under 71 N"),  # the discrepancy
        "> 0.99",
        "0.87 × the declared noise",
        *("rover.toml", "runs.csv", "seed 7", "needs speed_m_s"),
        "4 of 8 runs are shown",
    ):
        assert figure in text, figure


@pytest.mark.slow
def test_costs_of_runs_are_shown_where_they_are_given():
    costly = (NextRun("reverse", "the same slips in reverse", 7.25, (), cost=12.0),)
    plain, priced = (page(r, "m", "r") for r in (report(), report(next_runs=costly)))
    assert "per cost" in priced and ">cost</th>" in priced and ">12.0<" in priced
    assert "per cost" not in plain and ">cost</th>" not in plain


def test_an_unchanged_gap_is_shown_once():
    same = GapReduction(0.84, 0.84, {"torque_Nm": (0.84, 0.84)}, 9, "all rows fitted")
    whole = report("no-gap", gap={"train": same}, effects=(), cause_set=())
    html = page(replace(whole, soil_after=whole.soil_before), "m", "r")
    assert "before and after" not in html
    assert "Dashed lines" not in html


def test_non_finite_figures_are_rendered():
    nan, inf = float("nan"), float("inf")
    c = curves(channels=("sinkage_m",), slips=1)
    c = replace(c, before=np.full(8, nan), after_std=np.full(8, nan))
    odd = GapReduction(inf, nan, {"sinkage_m": (nan, 0.0)}, 0, "")
    old = {"n": EstimatedValue(nan, nan, "1"), "kphi": EstimatedValue(0.0, inf, "N/m^(n+2)")}
    soils = {"soil_before": old, "soil_after": old}
    whole = report(curves=c, gap={"train": odd}, remainder_probability=nan, **soils)
    read(
        page(replace(whole, where=(RegionScore("sinkage_m", (0, 1), (1, 2), inf, nan),)), "m", "r")
    )


def test_shown_runs_cover_all_loads():
    many = select_runs(curves(runs=16))
    assert len(many) == MOST_RUNS
    assert many[0].load == 40.0 and many[-1].load == 190.0
    assert len({run.colour for run in many}) == MOST_RUNS
    assert len(select_runs(curves(runs=1))) == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    "status, notes, words",
    [
        ("named", (), "Without the missing effect, the fit of the soil is biased."),
        ("class", (), "If slip-sinkage is the cause, the fit of the soil without it is biased"),
        (
            "suspected",
            (Remark("suspect-predicts", "...", ("grousers",)),),
            "If grousers is the cause, the fit of the soil without it is biased",
        ),
        ("suspected", (), "After: the soil alone beside a smooth discrepancy of unknown cause"),
        ("unknown", (), "After: the soil alone beside a smooth discrepancy of unknown cause"),
    ],
)
def test_the_soil_after_is_that_beside_what_the_model_contains(status, notes, words):
    whole = report(status, notes=notes, curves=None, best_unclaimed=("grousers",))
    if status not in ("named", "class"):
        whole = replace(whole, effects=())
    sentences = [
        "Without the missing effect, the fit of the soil is biased",
        "is the cause, the fit of the soil without it is biased",
        "After: the soil alone beside a smooth discrepancy",
    ]
    text = page(whole, "m", "r")
    assert words in text and sum(own in text for own in sentences) == 1


def test_the_page_says_which_explanations_a_run_separates_and_which_is_the_likeliest():
    compared = (("slip-sinkage",), ("slope", "camber"), ("grousers",))
    runs = (NextRun("reverse", "the same slips in reverse", 7.25, (), compared=compared),)
    text = page(report("class", next_runs=runs, curves=None), "m", "r")
    assert "of slip-sinkage from slope + camber and grousers, the mean over these." in text
    assert "with slip-sinkage, the likeliest of 2 explanations that the data do not reject" in text
