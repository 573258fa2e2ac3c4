"""Tables, logs and their answers through the server, as the page asks for them."""

import json
import sys
from pathlib import Path

import pytest
from conftest import MODEL
from served_page import ROOT, runs_file
from served_page import page as page

from soilml import Model, Wheel

pytestmark = pytest.mark.slow


@pytest.fixture
def runs(page, tmp_path):
    """The key of twelve rows in two runs."""
    file = runs_file(tmp_path, Model(Wheel(radius=0.15, width=0.12)))
    return page.put("RUNS.csv", file.read_bytes())


def written(page, job, name, **headers):
    status, found, text = page.request("GET", f"/api/jobs/{job['id']}/{name}", **headers)
    assert status == 200, text
    return found, text


@pytest.mark.parametrize("kind", ["identify", "pull", "gap"])
def test_an_answer_is_the_report_of_the_command(page, runs, kind):
    job = page.job(kind=kind, files=[runs], model=MODEL)
    assert job["state"] == "done", job["error"]
    assert job["result"]["command"].startswith(f"soilml {kind} MODEL.toml RUNS.csv ")
    headers, text = written(page, job, "report.html?show=1")
    assert b"<h1" in text and "sandbox" in headers["Content-Security-Policy"]
    assert "script" not in headers["Content-Security-Policy"]
    for name in job["result"]["files"]:
        assert "attachment" in written(page, job, name)[0]["Content-Disposition"]
    assert page.request("GET", f"/api/jobs/{job['id']}/MODEL.toml")[0] == 422
    if kind == "identify":  # of one run
        one = page.job(kind=kind, files=[runs], model=MODEL, run="run_1")
        assert json.loads(written(page, one, "report.json")[1])["rows_used"] == 6


def test_the_example_leads_from_nothing_to_a_table_and_a_model(page):
    job = page.job(kind="example", files=[])
    assert job["state"] == "done", job["error"]
    assert "[gear]" in written(page, job, "model.toml")[1].decode()
    table = page.job(kind="look", files=[f"{job['id']}/runs.csv"])["result"]
    assert table["kind"] == "runs" and table["rows"] == 36 and len(table["runs"]) == 6
    assert table["measured"] == ["drawbar_pull_N", "sinkage_m"]


def test_a_first_model_is_written_for_a_wheel(page):
    job = page.job(kind="init", files=[], radius=0.2, width=0.1)
    text = written(page, job, "MODEL.toml")[1].decode()
    assert "radius = 0.2" in text and "# sinkage_m = " in text and "# drawbar_pull_N = " in text
    job = page.job(kind="init", files=[], radius=-1, width=0.1)
    assert job["state"] == "failed" and "radius" in job["error"]
    assert not job["error"].startswith("soilml")


def test_a_job_can_be_cancelled_and_the_page_stays_live(page, runs):
    job, _ = page.ask("/api/jobs", {"kind": "gap", "files": [runs], "model": MODEL})
    assert page.request("POST", "/api/forward", {})[0] == 200
    _, _, text = page.request("DELETE", f"/api/jobs/{job['id']}", b"")
    assert json.loads(text)["state"] == "cancelled"
    again = json.loads(page.request("GET", f"/api/jobs/{job['id']}")[2])
    assert again["state"] == "cancelled" and again["result"] is None


def test_a_raw_log_is_guessed_corrected_and_imported(page, tmp_path):
    sys.path.insert(0, str(ROOT / "examples" / "import"))
    from rig import write_logs

    keys = [page.put(Path(f).name, Path(f).read_bytes()) for f in write_logs(tmp_path / "rig")[:1]]
    assert page.job(kind="look", files=keys)["result"] == {"kind": "log"}
    guess = page.job(kind="draft", files=keys)
    text = written(page, guess, "map.toml")[1].decode()
    assert "gear_ratio = 1  # CHANGE" in text
    wrong = page.job(kind="import", files=keys, map=text)
    assert wrong["state"] == "failed" and "gear" in wrong["error"]
    job = page.job(
        kind="import", files=keys, map=text.replace("gear_ratio = 1 ", "gear_ratio = 99 ")
    )
    assert job["state"] == "done", job["error"]
    assert b"<h1" in written(page, job, "runs.report.html?show=1")[1]
    again = page.job(kind="look", files=[f"{job['id']}/runs.csv"])["result"]
    assert again["kind"] == "runs" and again["rows"] == 4
