"""`soilml audit`: what a design could name, before anything is driven."""

import json

import numpy as np
import pytest
from conftest import THREE_CHANNEL_MODEL as MODEL

from soilml import Wheel
from soilml.cli import main
from soilml.physics.effects import EFFECTS

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
    command = ["audit", str(folder / "model.toml"), str(folder / "design.csv")]
    assert main([*command, "-v", "--out", str(folder / "audit.json"), *options]) == 0
    return json.loads((folder / "audit.json").read_text())


def by_name(found):
    return {e["name"]: e for e in found["effects"]}


@pytest.fixture(scope="module")
def usual(tmp_path_factory):
    """The audit of four loads at five slips."""
    return audited(tmp_path_factory.mktemp("audit"))


def test_every_effect_is_listed_or_said_to_be_untestable(usual):
    listed, cannot = set(by_name(usual)), set(usual["untestable"])
    wheel = Wheel(radius=0.1, width=0.1)
    assert listed | cannot == {name for name, e in EFFECTS.items() if e.applies_to(wheel)}
    assert not listed & cannot
    assert usual["untestable"]["rate"]["text"] == "needs the column speed_m_s"


def test_the_figures_fit_together(usual):
    order = [e["separating_snr"] for e in usual["effects"]]
    assert order == sorted(order, reverse=True)
    for e in usual["effects"]:
        assert 0.0 <= e["separating_snr"] <= e["residual_signal"] * (1 + 1e-9)
        assert e["residual_signal"] <= e["signal"] * (1 + 1e-9)
        assert e["absorbed"] == pytest.approx(1.0 - (e["residual_signal"] / e["signal"]) ** 2)
        assert e["nameable"] == (e["separating_snr"] >= 3.0)
        cosines = [r["cosine"] for r in e["rivals"]]
        assert cosines == sorted(cosines, reverse=True)
        assert e["name"] not in [r["name"] for r in e["rivals"]]
        sine = np.sqrt(max(0.0, 1.0 - cosines[0] ** 2))
        assert e["separating_snr"] == pytest.approx(e["residual_signal"] * sine)
        if e["detectable_size"] is not None:
            expected = 3.8416 * e["size"] / e["residual_signal"]
            assert e["detectable_size"] == pytest.approx(expected)


def test_what_looks_alike_is_one_class(usual):
    listed = by_name(usual)
    for names in usual["classes"]:
        assert len(names) > 1 and set(names) <= set(listed)


def test_better_sensors_see_the_same_effect_in_more_sigma(usual, tmp_path):
    sharp = by_name(audited(tmp_path, None, MODEL.replace("2 %", "1 %").replace("0.2", "0.1")))
    for name, e in by_name(usual).items():
        assert sharp[name]["signal"] == pytest.approx(2.0 * e["signal"], rel=1e-6)
        assert sharp[name]["absorbed"] == pytest.approx(e["absorbed"], abs=1e-6)


def test_driving_again_tells_more_and_absorbs_as_much(usual, tmp_path):
    twice = by_name(audited(tmp_path, design(loads=(40, 60, 90, 140) * 4)))
    for name, e in by_name(usual).items():
        assert twice[name]["residual_signal"] == pytest.approx(2.0 * e["residual_signal"], rel=1e-6)


def test_a_sensor_that_is_not_there_sees_nothing(tmp_path):
    blind = audited(tmp_path, None, MODEL.replace('sinkage_m = "2 %"\n', ""))
    assert "it changes no measured quantity" in blind["untestable"]["sinkage-gain"]["text"]


def test_more_free_parameters_absorb_more(usual, tmp_path):
    free = "cohesion,friction_angle,shear_modulus,kphi,n"
    wide = by_name(audited(tmp_path, None, MODEL, "--free", free))
    for name, e in by_name(usual).items():
        assert wide[name]["residual_signal"] <= e["residual_signal"] * (1 + 1e-6)
    assert wide["slip-sinkage"]["absorbed"] > 0.0


def test_speed_that_is_varied_makes_rate_testable(usual, tmp_path):
    found = audited(tmp_path, design(speeds=(0.02, 0.2, 0.05, 0.1)))
    assert "rate" in by_name(found)
    gained = {g for run in usual["added_runs"] for g in run["gained"]}
    kinds = {run["kind"]: run for run in usual["added_runs"]}
    assert "other speed" in kinds
    before = {e["name"] for e in usual["effects"] if e["nameable"]}
    assert not gained & before
    for run in usual["added_runs"]:
        assert run["nameable"] == len(before) + len(run["gained"])
    counts = [run["nameable"] for run in usual["added_runs"]]
    assert counts == sorted(counts, reverse=True)


def test_another_speed_is_predicted_by_what_depends_on_it(usual):
    runs = {run["kind"]: run for run in usual["added_runs"]}
    texts = [run["text"] for run in usual["added_runs"]]
    assert len(set(texts)) == len(texts)
    assert all(run["cost"] is None for run in usual["added_runs"])
    assert "rate" in runs["other speed"]["gained"]
    assert "multipass" not in runs["other speed"]["gained"]
    assert "multipass" in runs["second pass"]["gained"]


def test_runs_to_add_are_ranked_by_what_they_gain_per_cost(usual, tmp_path):
    costs = ["--cost", "other-speed=100", "--cost", "second pass=0.01"]
    found = audited(tmp_path, None, MODEL, *costs)
    assert found["effects"] == usual["effects"]
    gains = [len(run["gained"]) / run["cost"] for run in found["added_runs"]]
    assert gains == sorted(gains, reverse=True)
    assert {run["kind"]: run["cost"] for run in found["added_runs"]}["other speed"] == 100.0


def test_no_reading_is_looked_at_and_people_are_told_what_could_be_named(usual, tmp_path, capsys):
    lines = design().splitlines()
    text = "\n".join([lines[0] + ",torque_Nm", *(line + ",99" for line in lines[1:])]) + "\n"
    found = audited(tmp_path, text)
    assert found == usual
    said = capsys.readouterr().out
    assert said.startswith("These runs could name ")
    assert said.splitlines()[2].split()[:2] == ["effect", "nameable"]
    for name, e in by_name(found).items():
        (line,) = [line for line in said.splitlines() if line.split()[:1] == [name]]
        assert line.split()[1] == ("yes" if e["nameable"] else "no")
    assert "rate: needs the column speed_m_s" in said
    assert "runs to add, and the effects that could then be named:" in said


def test_without_out_nothing_is_written(tmp_path, capsys):
    (tmp_path / "model.toml").write_text(MODEL)
    (tmp_path / "design.csv").write_text("run,slip,load_N\na,0.3,60\nb,0.1,90\n")
    before = sorted(tmp_path.iterdir())
    assert main(["audit", str(tmp_path / "model.toml"), str(tmp_path / "design.csv")]) == 0
    assert sorted(tmp_path.iterdir()) == before
    assert "slip-sinkage" in capsys.readouterr().out
