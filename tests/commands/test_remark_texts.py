"""No decision reads the words of a remark: with any other words a command does the same."""

import hashlib
import json
from pathlib import Path

import pytest
from conftest import MODEL

from soilml.cli import main
from soilml.remarks import Remark
from soilml.report import page as pages

pytestmark = pytest.mark.slow

pytest.importorskip("jinja2")
pytest.importorskip("matplotlib")

ROOT = Path(__file__).parents[2]
#: A run of one row, which does not identify cohesion, and one that no soil explains.
RUNS = (
    "run,slip,load_N,torque_Nm\n"
    "a,0.3,80,3.2\n"
    "b,0.1,40,1.6\nb,0.3,80,2.0\nb,0.5,40,1.2\nb,0.2,60,3.0\nb,0.4,60,1.5\nb,0.3,40,2.0\n"
)
#: A remark without which the runs would not show what they are for.
SHOWN = {"identify": "excess-residuals", "estimate": "inconsistent"}
REPORTS = {
    "identify": ["model.toml", "runs.csv", "--by", "run", "--free", "cohesion,n"],
    "estimate": [str(ROOT / "exported/wheel.onnx"), "runs.csv", "--by", "run"],
    "pull": ["model.toml", "runs.csv", "--exact-model", "--load", "60", "--free", "cohesion"],
}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "model.toml").write_text(MODEL.replace("[noise]", "n = [0.8, 1.3]\n[noise]"))
    (tmp_path / "runs.csv").write_text(RUNS)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def other_words(monkeypatch):
    """A function from which on each remark has a checksum as its text."""
    made = Remark.__init__

    def make(self, code, text, *rest, **named):
        made(self, code, hashlib.sha256(text.encode()).hexdigest(), *rest, **named)

    return lambda: monkeypatch.setattr(Remark, "__init__", make)


def without_words(content):
    """JSON without sentences for people."""
    if isinstance(content, dict):
        return {key: without_words(value) for key, value in content.items() if key != "text"}
    return [without_words(value) for value in content] if isinstance(content, list) else content


@pytest.mark.parametrize("command", REPORTS)
def test_reports_are_decided_by_codes(folder, command, monkeypatch, capsys, other_words):
    made, render = [], pages.page
    monkeypatch.setattr(pages, "page", lambda one, origin: made.append(one) or render(one, origin))

    def found():
        status = main([command, *REPORTS[command], "--report", "found"])
        content = without_words(json.loads((folder / "found/report.json").read_text()))
        content["report"]["next"] = len(content["report"]["next"])
        one = made.pop()
        tables = [(table.header, table.rows) for table in one.tables]
        return status, content, one.badge, one.tone, one.meaning, one.answer, tables

    before = found()
    codes = [w["code"] for w in before[1]["report"]["warnings"]]
    assert before[0] == 0 and codes
    assert SHOWN.get(command, codes[0]) in codes
    other_words()
    assert found() == before
    assert "use the interval" not in (folder / "found/report.html").read_text()


def test_advice_is_decided_by_codes(folder, capsys, other_words):
    def found():
        status = main(
            ["advise", "model.toml", "runs.csv", "--where", "run=a", "--free", "cohesion"]
        )
        captured = capsys.readouterr()
        said = [line for line in captured.err.splitlines() if not line.endswith("...")]
        return status, captured.out, len(said)

    before = found()
    other_words()
    assert found() == before and before[0] == 0 and before[2] > 0
