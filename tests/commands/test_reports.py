"""Reports: a page and a JSON file with the same numbers, written with the other outputs as one."""

import hashlib
import json
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from conftest import MODEL
from console import check_tables, rows_of

from soilml.cli import main
from soilml.report.numbers import pretty

pytest.importorskip("jinja2")
pytest.importorskip("matplotlib")

ROOT = Path(__file__).parents[2]
EVIL = "<script>alert(1)</script>"
RUNS = (
    "run,slip,load_N,torque_Nm\n"
    "a,0.1,40,0.75\na,0.3,80,3.2\na,0.5,40,1.95\n"
    f"{EVIL},0.1,80,1.8\n{EVIL},0.3,40,1.4\n{EVIL},0.5,80,4.1\n"
)


class Seen(HTMLParser):
    """Tags, text, and what the page would fetch."""

    def __init__(self, html):
        super().__init__()
        self.tags, self.text, self.fetched = [], "", []
        self.feed(html)

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.fetched += [v for k, v in attrs if k in ("src", "href", "srcset", "data")]
        assert not any(key.startswith("on") for key, _ in attrs)

    def handle_data(self, data):
        self.text += data


@pytest.fixture
def folder(workplace):
    (workplace / "model.toml").write_text(MODEL)
    (workplace / "runs.csv").write_text(RUNS)
    return workplace


COMMANDS = {
    "identify": ["identify", "model.toml", "runs.csv", "--by", "run"],
    "estimate": ["estimate", str(ROOT / "exported/wheel_linear.onnx"), "runs.csv", "--by", "run"],
    "pull": [
        "pull",
        "model.toml",
        "runs.csv",
        *("--load=60", "--slip-limit=0.4", "--by=run", "--exact-model"),
    ],
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", COMMANDS)
def test_a_report_is_a_page_and_a_file_with_what_was_asked_and_found(folder, kind, capsys):
    command = [*COMMANDS[kind], "--report", "found/deeper"]
    assert main(command) == 0
    check_tables(capsys.readouterr().out)
    place = folder / "found" / "deeper"
    assert sorted(path.name for path in place.iterdir()) == ["report.html", "report.json"]
    html = (place / "report.html").read_text()
    seen = Seen(html)
    assert "script" not in seen.tags and EVIL in seen.text
    assert all(target.startswith(("data:", "#")) for target in seen.fetched)
    assert "http:" not in html and "https:" not in html and "@import" not in html
    assert "@media print" in html and "prefers-color-scheme: dark" in html
    assert "svg" in seen.tags and "table" in seen.tags
    entry = json.loads((place / "report.json").read_text())["report"]
    assert (entry["format"], entry["version"], entry["kind"]) == ("soilml-report", 3, kind)
    assert entry["command"] in seen.text
    sums = {Path(f["name"]).name: f["sha256"] for f in entry["files"]}
    assert sums["runs.csv"] == hashlib.sha256(RUNS.encode()).hexdigest()
    assert sums["runs.csv"] in seen.text
    plain = " ".join(seen.text.replace("\N{NO-BREAK SPACE}", " ").split()).lower()
    for said in (*entry["answer"], *entry["warnings"], *entry["next"]):
        text = said["text"] if isinstance(said, dict) else said
        assert " ".join(pretty(text).split()).lower() in plain


@pytest.mark.slow
def test_the_file_of_a_report_has_the_numbers_of_the_table(folder, capsys):
    assert main([*COMMANDS["estimate"], "--report", "found", "--out", "all.csv"]) == 0
    rows = rows_of((folder / "all.csv").read_text())
    columns = json.loads((folder / "found/report.json").read_text())["columns"]
    assert list(columns) == list(rows[0])
    for name in ("cohesion_Pa", "friction_angle_rad_std", "shear_modulus_m_p95"):
        np.testing.assert_allclose(columns[name], [float(r[name]) for r in rows], rtol=1e-9)
    command = [*COMMANDS["identify"], "--method", "posterior", "--report", "found"]
    assert main([*command, "--out", "all.json"]) == 0
    found = json.loads((folder / "found/report.json").read_text())
    del found["report"]
    assert found == json.loads((folder / "all.json").read_text())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "code", "about"),
    [
        ("wheel_linear", "not-identified", ["cohesion", "friction_angle"]),
        ("wheel", "channels-used", ["torque"]),
    ],
)
def test_a_remark_of_an_estimate_has_its_code_and_what_it_is_about(folder, name, code, about):
    command = ["estimate", name, "runs.csv", "--by", "run", "--report", "found", "--out", "o.csv"]
    assert main(command) == 0
    remarks = json.loads((folder / "found/report.json").read_text())["report"]["warnings"]
    assert {one["code"]: one["about"] for one in remarks}[code] == about
