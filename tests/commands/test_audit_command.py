"""`soilml audit`: what a design could name, before anything is driven."""

import json

import numpy as np
import pytest
from conftest import THREE_CHANNEL_MODEL as MODEL

from soilml.cli import main

pytestmark = pytest.mark.slow


def design(loads=(40, 60, 90, 140), slips=5, speeds=None):
    lines = ["run,slip,load_N" + (",speed_m_s" if speeds else "")]
    for i, load in enumerate(loads):
        for slip in np.linspace(0.06, 0.6, slips):
            speed = f",{speeds[i]}" if speeds else ""
            lines.append(f"run_{i},{slip:.4f},{load}{speed}")
    return "\n".join(lines) + "\n"


def audited(folder, text=None, model=MODEL, *options):
    (folder / "model.toml").write_text(model)
    (folder / "design.csv").write_text(text or design())
    command = ["plan", "effects", str(folder / "model.toml"), str(folder / "design.csv")]
    assert main([*command, "-v", "--out", str(folder / "audit.json"), *options]) == 0
    return json.loads((folder / "audit.json").read_text())


def by_name(found):
    return {e["name"]: e for e in found["effects"]}


@pytest.fixture(scope="module")
def usual(tmp_path_factory):
    """The audit of four loads at five slips."""
    return audited(tmp_path_factory.mktemp("audit"))


def test_the_figures_fit_together(usual):
    order = [e["separating_snr"] for e in usual["effects"]]
    assert order == sorted(order, reverse=True)
    for e in usual["effects"]:
        assert 0.0 <= e["separating_snr"] <= e["residual_signal"] * (1 + 1e-9)
        assert e["residual_signal"] <= e["signal"] * (1 + 1e-9)
        assert e["absorbed"] == pytest.approx(1.0 - (e["residual_signal"] / e["signal"]) ** 2)
        assert e["nameable"] == (e["separating_snr"] >= 3.0)
        assert e["rival"] != e["name"]
        sine = np.sqrt(max(0.0, 1.0 - e["cosine"] ** 2))
        assert e["separating_snr"] == pytest.approx(e["residual_signal"] * sine)
        if e["detectable_size"] is not None:
            expected = 3.8416 * e["size"] / e["residual_signal"]
            assert e["detectable_size"] == pytest.approx(expected)


def test_speed_that_is_varied_makes_rate_testable(usual, tmp_path):
    found = audited(tmp_path, design(speeds=(0.02, 0.2, 0.05, 0.1)))
    assert "rate" in by_name(found)
    assert "rate" in usual["untestable"]
