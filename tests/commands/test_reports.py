"""Reports: a page and a JSON file with the same numbers, written with the other outputs as one."""

import csv
import hashlib
import html
import json
import os
import re
import subprocess
import sys
from base64 import b64decode
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from conftest import MODEL

from soilml.cli import main

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
def folder(tmp_path, monkeypatch):
    (tmp_path / "model.toml").write_text(MODEL)
    (tmp_path / "runs.csv").write_text(RUNS)
    monkeypatch.chdir(tmp_path)
    return tmp_path


COMMANDS = {
    "identify": ["identify", "model.toml", "runs.csv", "--by", "run"],
    "estimate": ["estimate", str(ROOT / "exported/wheel_linear.onnx"), "runs.csv", "--by", "run"],
    "pull": [
        "pull",
        "model.toml",
        "runs.csv",
        "--load",
        "60",
        "--slip-limit",
        "0.4",
        "--by",
        "run",
    ],
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", COMMANDS)
def test_a_report_is_a_page_and_a_file_with_what_was_asked_and_found(folder, kind, capsys):
    command = [*COMMANDS[kind], "--report", "found/deeper"]
    assert main(command) == 0
    place = folder / "found" / "deeper"
    assert sorted(path.name for path in place.iterdir()) == ["report.html", "report.json"]
    html = (place / "report.html").read_text()
    seen = Seen(html)
    assert "script" not in seen.tags and EVIL in seen.text
    assert all(target.startswith("data:") for target in seen.fetched)
    assert "http:" not in html and "https:" not in html and "@import" not in html
    assert "@media print" in html and "prefers-color-scheme: dark" in html
    assert "img" in seen.tags and "table" in seen.tags
    entry = json.loads((place / "report.json").read_text())["report"]
    assert (entry["format"], entry["version"], entry["kind"]) == ("soilml-report", 3, kind)
    assert entry["command"] in seen.text
    sums = {Path(f["name"]).name: f["sha256"] for f in entry["files"]}
    assert sums["runs.csv"] == hashlib.sha256(RUNS.encode()).hexdigest()
    assert sums["runs.csv"] in seen.text
    plain = " ".join(seen.text.replace("\N{NO-BREAK SPACE}", " ").split()).lower()
    for said in (*entry["answer"], *entry["warnings"], *entry["next"]):
        text = said["text"] if isinstance(said, dict) else said
        assert " ".join(text.split()).lower() in plain


@pytest.mark.slow
def test_the_file_of_a_report_has_the_numbers_of_the_table(folder, capsys):
    assert main([*COMMANDS["estimate"], "--report", "found", "--out", "all.csv"]) == 0
    rows = list(csv.DictReader((folder / "all.csv").read_text().splitlines()))
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
def test_no_file_is_written_where_the_page_fails(folder, monkeypatch, capsys):
    def fails(*args):
        raise KeyboardInterrupt

    before = sorted(folder.rglob("*"))
    monkeypatch.setattr("soilml.report.page.page", fails)
    command = [*COMMANDS["identify"], "--method", "nonlinear", "--report", "found"]
    assert main([*command, "--out", "all.json"]) == 130
    assert "no output was written" in capsys.readouterr().err
    assert sorted(folder.rglob("*")) == before


def test_bad_folders_are_one_line(folder, capsys):
    for path, said in (
        ("runs.csv", "is a file; needed is a folder"),
        ("x.html", "is the name of a file; needed is a folder, for report.html and report.json"),
        ("", "--report is empty"),
    ):
        assert main([*COMMANDS["identify"], "--report", path]) == 2
        error = capsys.readouterr().err
        assert error.count("\n") == 1 and said in error
    assert main([*COMMANDS["estimate"][:2], "--report", "found"]) == 2
    assert "RUNS.csv is missing" in capsys.readouterr().err


@pytest.mark.slow
def test_what_rows_do_not_determine_is_said_and_not_given_as_a_result(folder, capsys):
    (folder / "runs.csv").write_text("run,slip,load_N,torque_Nm\na,0.3,80,3.2\n")
    command = ["identify", "model.toml", "runs.csv", "--method", "posterior", "--report", "found"]
    assert main(command) == 0
    text = Seen((folder / "found/report.html").read_text()).text
    assert "one load only: cohesion is not identified" in text.lower()
    assert "Cohesion c is not determined by these rows" in text and "Cohesion c =" not in text
    assert "not determined (" not in text and "partly identified" in text


@pytest.mark.slow
@pytest.mark.parametrize("command", ["pull", "advise"])
def test_hints_at_wrong_units_come_with_every_command(folder, command, capsys):
    wrong = RUNS.replace("0.75", "75").replace("3.2", "320").replace("1.95", "195")
    wrong = wrong.replace("1.8", "180").replace("1.4", "140").replace("4.1", "410")
    (folder / "runs.csv").write_text(wrong)
    main([command, "model.toml", "runs.csv"])
    assert "! runs.csv: torque is" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.filterwarnings("error")
def test_runs_of_any_name_are_drawn_without_a_warning(folder, capsys):
    names = ["\u6f22\u5b57\u7802", "x" * 256, "W" * 256, "$\\frac$", "_a"]
    header, _, *rows = RUNS.splitlines()
    rows = [row.replace(EVIL, name) for name in names for row in rows if row.startswith(EVIL)]
    (folder / "runs.csv").write_text("\n".join([header, *rows, ""]), encoding="utf-8")
    assert main([*COMMANDS["identify"], "--report", "page"]) == 0
    assert "warning" not in capsys.readouterr().err.lower()
    (page,) = (folder / "page").glob("*.html")
    images = re.findall(r"svg\+xml;base64,([\w+/=]+)", page.read_text(encoding="utf-8"))
    shown = html.unescape(b64decode(images[0]).decode())
    for name in names:
        assert f"run {name}, exact" in shown or f"run {name[:16]}…" in shown


def drawn_apart(folder, settings):
    """A picture by a process of its own."""
    words = "simulate model.toml --slip 0.1,0.3 --load 60 --picture a.png"
    return subprocess.run(
        [sys.executable, "-m", "soilml", *words.split()],
        cwd=folder, capture_output=True, text=True,
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT), *sys.path])} | settings,
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(
    ("settings", "file"),
    [
        ({"MPLBACKEND": "foo"}, b""),
        ({"HOME": os.devnull, "MPLCONFIGDIR": ""}, b""),
        ({}, b"junk : 3\nbackend: foo\n"),
    ],
    ids=["backend", "home", "matplotlibrc"],
)
def test_pictures_do_not_depend_on_settings_of_matplotlib(folder, settings, file):
    (folder / "matplotlibrc").write_bytes(file)
    done = drawn_apart(folder, settings)
    assert done.returncode == 0, done.stderr
    assert (folder / "a.png").read_bytes().startswith(b"\x89PNG")
    assert not re.search("matplotlib|mkdir|Bad key", done.stderr)


@pytest.mark.slow
def test_a_broken_settings_file_of_matplotlib_is_one_line(folder):
    (folder / "matplotlibrc").write_bytes(b"\xff")
    done = drawn_apart(folder, {})
    assert done.returncode == 2 and done.stderr.count("\n") == 1
    assert "look for a file matplotlibrc" in done.stderr
    assert not (folder / "a.png").exists()
