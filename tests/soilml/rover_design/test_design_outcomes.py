"""What designs do, against the rover of `pull`; draws of soils and errors; shares of variance."""

import math
from dataclasses import replace

import numpy as np
import pytest
from design_files import STUDY

from soilml import Case, Grousers, Model, Wheel, soil
from soilml.config.wheeled_rover import RoverWheel, WheeledRover
from soilml.rover_design.performance import Outcomes, evaluate
from soilml.rover_design.study import read_study
from soilml.rover_design.uncertainty import possible_tests, variance_shares
from soilml.rover_design.worlds import draw_worlds
from soilml.traction.draws import SoilDraws
from soilml.traction.vehicle import DrivenVehicle, performance

SPREAD = "\n[soil.prior]\nfriction_angle = [0.5, 0.7]\nshear_modulus = [0.008, 0.02]\n\n[goal]"


@pytest.fixture
def study(tmp_path):
    (tmp_path / "rover.toml").write_text(STUDY.replace("\n[goal]", SPREAD))
    return read_study(tmp_path / "rover.toml")


def without_errors(worlds):
    """The same soils under a model that is exactly right."""
    return replace(
        worlds,
        errors={name: 0.0 * values for name, values in worlds.errors.items()},
        lacking=(),
        acts=np.zeros((worlds.count, 0), bool),
        weights=0.0 * worlds.weights,
        lug_shearing=np.full(worlds.count, 0.75),
    )


def designs(width, lug_height, **others):
    width, lug_height = np.broadcast_arrays(np.asarray(width, float), np.asarray(lug_height, float))
    own = {"radius": 0.09, "wheels": 4.0, "mass": 12.0} | others
    shared = {name: np.full(width.shape, value) for name, value in own.items()}
    return {"width": width, "lug_height": lug_height, **shared}


@pytest.mark.parametrize("lug", [0.0, 0.01])
def test_a_design_does_what_pull_says_of_the_same_rover(study, lug):
    worlds = without_errors(draw_worlds(study.soil, 30, 0.6))
    shares = np.linspace(0.05, 1.0, 20)
    found = evaluate(study, designs(0.08, [lug]), worlds, shares=shares)
    model = Model(Wheel(radius=0.09, width=0.08))
    if lug:
        model = model + Grousers(height=lug, shearing=0.75, rim_slip=1.0)
    wheels = {f"{x}{y}": RoverWheel(x, y) for x in (0.2, -0.2) for y in (0.3, -0.3)}
    rover = WheeledRover(12.0, (0.02, 0.0, 0.18), wheels)
    names = ("friction_angle", "shear_modulus")
    draws = SoilDraws(names, np.stack([worlds.soil[n] for n in names], axis=1))
    case = Case(model, soil("ding2015/hit_lss1"), rover=rover)
    slope = np.asarray([study.goal.slope])
    known = performance(DrivenVehicle.of_rover(case), draws, slope, 0.6 * shares)
    # `performance` has more slips below the first one, where nothing is needed here
    assert found.margin[0] == pytest.approx(known.margin[:, 0], rel=1e-6, abs=1e-6)
    needed = found.slip[0] > 0.06
    assert needed.sum() > 10
    assert found.slip[0][needed] == pytest.approx(known.slip[needed, 0], rel=1e-6)
    assert found.energy[0][needed] == pytest.approx(known.energy[needed, 0], rel=1e-6)
    torque = np.max([t[:, 0] for t in known.torque.values()], axis=0)
    assert found.torque[0][needed] == pytest.approx(torque[needed], rel=1e-6)


def test_soils_keep_to_their_ranges_and_are_equally_likely(tmp_path):
    text = STUDY.replace(
        'name = "ding2015/hit_lss1"', 'names = ["scott1970/apollo12", "mckay1994/jsc-1"]'
    )
    (tmp_path / "rover.toml").write_text(text)
    worlds = draw_worlds(read_study(tmp_path / "rover.toml").soil, 600, 0.6)
    assert np.bincount(worlds.kind).tolist() == [300, 300]
    moon = worlds.kind == worlds.kinds.index("scott1970/apollo12")
    angle = np.rad2deg(worlds.soil["friction_angle"])
    assert angle[moon].min() < 35.1 and angle[moon].max() > 38.9
    assert np.ptp(angle[~moon]) == 0.0
    assumed = [r.about[0] for r in worlds.remarks if r.code == "assumed-soil"]
    assert assumed == list(worlds.kinds)


def test_shares_of_a_margin_that_is_known(study):
    worlds = draw_worlds(study.soil, 4000, 0.6)
    angle, contact = worlds.soil["friction_angle"], worlds.errors["contact"]
    margin = 3.0 * (angle - angle.mean()) / angle.std() + contact / contact.std()
    none = np.zeros((1, worlds.count))
    outcome = Outcomes(margin[None], none, none, none, none, none, none > 0)
    shares = {one.inputs[0]: one.share for one in variance_shares(worlds, outcome)}
    assert shares["friction_angle"] == pytest.approx(0.9, abs=0.02)
    assert shares["contact"] == pytest.approx(0.1, abs=0.02)
    assert "lug_shearing" not in shares and shares.get("shear_modulus", 0.0) < 0.01
    first = possible_tests(worlds, outcome)[0]
    assert "friction_angle" in first.inputs and first.share == pytest.approx(0.9, abs=0.02)
    assert first.left == pytest.approx(math.sqrt(1.0 - first.share))
