"""A tracked robot from the shell: how it stands in the soil, and its soil as a mean of groups."""

import json

import numpy as np
import pytest
from console import rows_printed

from soilml import read_case, simulate
from soilml.cli import main

MODEL = """\
[gear]
type = "track"
radius = 0.1
width = 0.08
base = 0.6
[soil]
name = "wang2018/sand"
[soil.prior]
friction_angle = [0.349, 0.698]
shear_modulus = [0.01, 0.08]
[noise]
drawbar_pull_N = "3 % + 5"
"""
WORDS = ("status", "traffic_class")  # columns of words
SIMULATE = ["simulate", "m.toml", "--slip", "0.02,0.1,0.3", "--load", "638", "--balance"]


@pytest.fixture
def folder(workplace):
    (workplace / "m.toml").write_text(MODEL)
    return workplace


def test_the_shares_carry_the_load(folder, capsys):
    rows = rows_printed([*SIMULATE, "--efficiency", "--picture", "t.png"], capsys)
    cells = {name: [row[name] for row in rows] for name in rows[0] if name not in WORDS}
    level = {name: np.asarray(own, float) for name, own in cells.items()}
    parts = [level[f"{part}_share"] for part in ("front", "belt", "rear")]
    np.testing.assert_allclose(sum(parts), 1.0, atol=1e-9)
    rear = level["rear_sinkage_m"]
    np.testing.assert_allclose(rear, 1.2 * level["sinkage_m"])  # R_1f of the default
    assert (np.diff(rear) < 0.0).all()
    ratio = (1.0 - level["slip"]) * 0.1 * level["drawbar_pull_N"] / level["torque_Nm"]
    np.testing.assert_allclose(level["tractive_efficiency"], ratio)
    assert (folder / "t.png").read_bytes().startswith(b"\x89PNG")


MEAN = ["identify", "m.toml", "runs.csv", "--method", "nonlinear", "--by", "run", "--mean"]


@pytest.mark.slow
def test_the_mean_of_groups(folder, capsys):
    case, slip = read_case("m.toml"), np.linspace(0.05, 0.85, 8)
    text = "run,slip,load_N,drawbar_pull_N\n"
    for seed in range(4):
        pull = simulate(case, slip, 638.0, seed=seed)["drawbar_pull_N"]
        text += "".join(f"g{seed},{s},638,{p}\n" for s, p in zip(slip, pull, strict=True))
    (folder / "runs.csv").write_text(text)
    assert main([*MEAN, "--report", "found"]) == 0
    said = capsys.readouterr().out
    content = json.loads((folder / "found" / "report.json").read_text())
    each = [run["parameters"]["friction_angle"]["value"] for run in content["runs"].values()]
    own = content["mean"]["parameters"]["friction_angle"]
    assert len(each) == 4 and own["value"] == pytest.approx(np.mean(each))
    assert abs(own["value"] - 0.4363) < 3.0 * own["std"]
    assert "run mean of 4" in said
    page = (folder / "found" / "report.html").read_text()
    assert "run mean of 4" in page
