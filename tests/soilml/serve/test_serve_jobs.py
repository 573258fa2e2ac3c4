"""Tables, logs, estimates and gaps through the server, as the page asks for them."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from served_page import ROOT
from served_page import page as page

from soilml import Model, Operating, Wheel, soil
from soilml.io.text_tables import csv_text

pytestmark = pytest.mark.slow

RUNS = "run,slip,load_N,torque_Nm\n"


def runs_text(count=6):
    """Rows of the first wheel on its soil, with 2 % of noise on the torque."""
    slip, load = np.tile(np.linspace(0.1, 0.6, count), 2), np.repeat([40.0, 90.0], count)
    force = Model(Wheel(radius=0.15, width=0.12))(
        soil("wong1989/dry_sand"), Operating(slip=slip, load=load)
    )
    noise = 1.0 + 0.02 * np.random.default_rng(5).standard_normal(slip.size)
    names = np.repeat(["light", "heavy"], count)
    columns = {"run": names, "slip": slip, "load_N": load, "torque_Nm": force.torque * noise}
    return csv_text(columns).encode()


def test_a_table_of_runs_is_known_and_estimated(page):
    key = page.put("RUNS.csv", runs_text())
    job = page.job(kind="look", files=[key])
    assert job["state"] == "done", job["error"]
    table = job["result"]
    assert table["kind"] == "runs" and table["runs"] == ["light", "heavy"] and table["rows"] == 12
    job = page.job(kind="estimate", files=[key], model={"values": {}})
    assert job["state"] == "done", job["error"]
    found = {p["path"]: p for p in job["result"]["parameters"]}
    angle = found["friction_angle"]
    assert angle["unit"] == "°" and angle["band"][0] < 28.0 < angle["band"][1]
    assert angle["prior"][0] < angle["band"][0] and angle["band"][1] < angle["prior"][2] + 10.0
    assert job["result"]["next"].startswith("slip ")
    pull = job["result"]["pull"]["loads"][0]
    assert np.all(np.asarray(pull["pull"][0]) <= np.asarray(pull["pull"][2]))
    status, headers, text = page.request("GET", f"/api/jobs/{job['id']}/identify.json")
    assert status == 200 and "attachment" in headers["Content-Disposition"]
    values = json.loads(text)["parameters"]
    assert values["friction_angle"]["value"] == pytest.approx(angle["si"])


def test_a_gap_runs_with_progress_and_its_files_are_there(page):
    key = page.put("RUNS.csv", runs_text(7))
    job = page.job(kind="gap", files=[key], model={"values": {}})
    assert job["state"] == "done", job["error"]
    found = job["result"]
    assert found["status"] == "no-gap" and found["advice"] and found["sizes"]
    assert {"report.html", "gap.json", "model.toml", "next_runs.csv"} <= set(found["files"])
    path = f"/api/jobs/{job['id']}/report.html"
    status, headers, text = page.request("GET", f"{path}?show=1")
    assert status == 200 and b"Gap report" in text
    assert "sandbox" in headers["Content-Security-Policy"]
    assert "script" not in headers["Content-Security-Policy"]
    assert "attachment" in page.request("GET", path)[1]["Content-Disposition"]
    assert page.request("GET", f"/api/jobs/{job['id']}/MODEL.toml")[0] == 422


def test_a_job_can_be_cancelled_and_the_page_stays_live(page):
    key = page.put("RUNS.csv", runs_text(7))
    job, _ = page.ask("/api/jobs", {"kind": "gap", "files": [key], "model": {"values": {}}})
    assert page.request("POST", "/api/forward", {})[0] == 200
    _, _, text = page.request("DELETE", f"/api/jobs/{job['id']}", b"")
    assert json.loads(text)["state"] == "cancelled"
    again = json.loads(page.request("GET", f"/api/jobs/{job['id']}")[2])
    assert again["state"] == "cancelled" and again["result"] is None


def test_a_raw_log_is_guessed_edited_and_imported(page, tmp_path):
    sys.path.insert(0, str(ROOT / "examples" / "import"))
    from rig import write_logs

    keys = [page.put(Path(f).name, Path(f).read_bytes()) for f in write_logs(tmp_path / "rig")[:1]]
    assert page.job(kind="look", files=keys)["result"] == {"kind": "log"}
    guessed = page.job(kind="map", files=keys)["result"]
    assert "gear_ratio = 1  # CHANGE" in guessed["map"] and guessed["marked"] == 1
    wrong = page.job(kind="import", files=keys, map=guessed["map"])
    assert wrong["state"] == "failed" and "gear" in wrong["error"]
    fixed = guessed["map"].replace("gear_ratio = 1 ", "gear_ratio = 99 ")
    job = page.job(kind="import", files=keys, map=fixed)
    assert job["state"] == "done", job["error"]
    assert job["result"]["rows"] == 4 and job["result"]["load"][0] == pytest.approx(40.0, abs=1.0)
    assert page.request("GET", f"/api/jobs/{job['id']}/import_report.html?show=1")[0] == 200
    again = page.job(kind="look", files=[f"{job['id']}/runs.csv"])
    assert again["result"]["kind"] == "runs" and again["result"]["rows"] == 4


def test_the_pull_is_that_of_usual_errors_and_of_each_wheel(page):
    """Wider than as if the model file were right; with several wheels, a curve for each of them."""
    lines = runs_text(6).decode().replace("\r", "").splitlines()
    light = [line for line in lines[1:] if not line.startswith("heavy")]
    content = lines[0] + ",gear\n" + "".join(f"{line},{gear}\n" for gear in "ab" for line in light)
    wheel = 'type = "wheel"\nradius = 0.15\nwidth = 0.12\n'
    soil_of = '[soil]\nname = "wong1989/dry_sand"\n[soil.prior]\nfriction_angle = [0.4, 0.8]\n'
    text = f'[gears.a]\n{wheel}[gears.b]\n{wheel}{soil_of}[noise]\ntorque_Nm = "2 %"\n'
    results = {}
    for name, model in (("usual", text), ("stated", text + '[discrepancy]\ntorque_Nm = "1 %"\n')):
        job = page.job(
            kind="estimate", files=[page.put("R.csv", content.encode())], model={"model": model}
        )
        assert job["state"] == "done", job["error"]
        results[name] = job["result"]
    usual, stated = results["usual"], results["stated"]
    assert [one["gear"] for one in usual["pull"]["loads"]] == ["a", "b"]
    assert usual["explanations"] and not stated["explanations"]
    widths = [r["pull"]["loads"][0]["largest_pull"] for r in (usual, stated)]
    assert widths[0][2] - widths[0][0] > widths[1][2] - widths[1][0]
