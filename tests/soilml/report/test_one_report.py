"""One report renders as text, page, JSON, Markdown and notebook view, with the same numbers."""

import json
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from soilml.remarks import Remark
from soilml.report.numbers import format_quantity, pretty
from soilml.report.page import Provenance, json_text, page, report_entry
from soilml.report.report import Picture, Report, by_group
from soilml.report.tables import Column, ReportTable

EVIL = '<script>alert("x")</script>&\'$\\frac{'
VOID = {"meta", "link", "br", "img", "hr", "input"}


def draw(axes):
    for panel in np.ravel(axes):
        panel.plot([0.0, 1.0], [0.0, 2.0], color="#005b96")
        panel.set_title(EVIL)


def report(**changes):
    soil = ReportTable(
        "Soil",
        [
            Column("parameter", ["cohesion c", "frictional modulus of sinkage k_phi"]),
            Column(
                "value",
                [1255.36, 1.892e6],
                ["Pa", "N/m^(n+2)"],
                [794.3, 2e4],
                ([210.0, 1.86e6], [2600.0, 1.92e6]),
            ),
        ],
    )
    curve = ReportTable.of("Curve", {"slip": [0.1, 0.3], "sinkage_m": [0.0123, 0.0234]})
    whole = Report(
        kind="identify",
        verdict="The model fits these rows; 2 rows determine the soil.",
        lines=["A second line -> with an arrow."],
        figures=soil,
        tables=[curve],
        pictures=[Picture("Picture", draw, 1, 2, (8.0, 3.0), "two lines", "Both rise.")],
        remarks=[Remark("a", "a warning"), Remark("b", "a note", severity="note")],
        next_steps=["measure again"],
        details=[("Details", ["one", "two"])],
        status="identified",
        tone="good",
        title="Soil",
    )
    return replace(whole, **changes)


class Checked(HTMLParser):
    """Tags that open and close in order, ids that occur once, nothing that is fetched."""

    def __init__(self, html):
        super().__init__()
        self.open, self.ids, self.tags, self.text = [], [], [], []
        self.feed(html)
        self.close()
        assert not self.open and len(set(self.ids)) == len(self.ids)

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        for key, value in attrs:
            assert not key.startswith("on")
            if key == "id":
                self.ids.append(value)
            if key in ("src", "href"):
                assert value.startswith(("#", "data:"))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)


ORIGIN = Provenance("soilml identify", "0")


def test_the_numbers_of_a_report_are_the_same_in_every_form():
    whole = report()
    text, html = whole.text(), page(whole, ORIGIN)
    plain = " ".join(Checked(html).text)
    for number in ("1.26 +- 0.79", "0.21 to 2.60", "1.892 +- 0.020"):
        assert number in text
        assert pretty(number) in plain and pretty(number) in whole._repr_html_()
    assert "kPa" in text and "MN/m^(n+2)" in text and "MN/mⁿ⁺²" in plain
    assert text.startswith(whole.verdict)
    assert whole.summary().splitlines()[2].startswith("cohesion c = 1.26 +- 0.79 kPa (90 %: 0.21")
    entry = json.loads(json_text(report_entry(whole, ORIGIN)))
    assert entry["answer"][0] == whole.verdict and entry["warnings"][0]["code"] == "a"


def test_a_terminal_shows_what_matters_and_the_rest_with_details():
    short, whole = report().text(), report().text(details=True)
    assert "! a warning" in short and "a note" not in short and "Curve" not in short
    assert "(1 remark, 1 table, details more: -v)" in short
    assert "12.3" in whole and "sinkage, mm" in whole and "- one" in whole and "! a note" in whole
    many = [Remark(f"{i}", f"warning {i}") for i in range(9)]
    assert report(remarks=many).text().count("! warning") == 5
    wide = ReportTable.of("wide", {f"column_{i}_N": [123.0] for i in range(20)})
    lines = wide.text().splitlines()
    assert max(map(len, lines)) <= 80 and lines[3].startswith("not shown here: ")


def test_a_page_is_self_contained_follows_dark_mode_and_escapes_all_text():
    pytest.importorskip("matplotlib")
    evil = report(
        verdict=EVIL,
        lines=[EVIL],
        title=EVIL,
        remarks=[Remark("x", EVIL)],
        details=[(EVIL, [EVIL])],
        next_steps=[EVIL],
        tables=[ReportTable(EVIL, [Column(EVIL, [EVIL])], EVIL)],
        notation=[(EVIL, EVIL)],
    )
    html = page(evil, ORIGIN)
    seen = Checked(html)
    assert "<script" not in html and "script" not in seen.tags and EVIL in "".join(seen.text)
    assert "http:" not in html and "https:" not in html and "@import" not in html
    assert seen.tags.count("caption") == seen.tags.count("table")
    assert seen.tags.count("svg") == 2  # an image for each column of panels
    assert 'stroke="var(--after)"' in html and "prefers-color-scheme: dark" in html
    assert not re.search(r"<svg.*?style=", html)
    assert html == page(evil, ORIGIN)


def test_a_page_shows_parts_of_files_as_they_are():
    pytest.importorskip("matplotlib")
    whole = report(details=[("For the file", ["[bias]\nslip = -0.01\n"]), ("More", ["slip is -1"])])
    html = page(whole, ORIGIN)
    assert "<pre>[bias]\nslip = -0.01\n</pre>" in html and "<li>Slip is −1</li>" in html


def test_a_command_in_a_sentence_is_code():
    pytest.importorskip("matplotlib")
    html = page(report(verdict="Run `soilml <gap>`."), ORIGIN)
    assert ">Run <code>soilml &lt;gap&gt;</code>.</p>" in html


def test_groups_of_rows_are_one_report():
    both = by_group({"a": report(), "b": report()}, {"c": "too few rows"}, "run", "2 results.", "t")
    heads, rows, _ = both.tables[0].cells()
    assert heads[:2] == ["run", "parameter"] and [row[0] for row in rows] == ["a", "a", "b", "b"]
    assert both.lines[0].startswith("run a: The model fits")
    assert [r.text for r in both.remarks][-1] == "run c has no result: too few rows"


@pytest.mark.parametrize("value", [float("nan"), float("inf"), 0.0, -1e-12, 1e12])
def test_odd_numbers_are_shown(value):
    table = ReportTable("odd", [Column("x", [value], "Pa", [value], ([value], [value]))])
    assert table.text() and isinstance(format_quantity(value, "rad", value), str)
