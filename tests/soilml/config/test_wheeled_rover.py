"""A rover by its wheels: loads on a slope, ruts, and what its section may contain."""

from dataclasses import replace

import numpy as np
import pytest

from soilml import read_case
from soilml.config.wheeled_rover import RoverWheel, WheeledRover, read_gravity
from soilml.config.write_case import case_as_toml
from soilml.errors import InputError

SIX = {
    f"{end}-{side}": RoverWheel(x, y)
    for end, x in (("front", 0.5), ("middle", 0.1), ("rear", -0.4))
    for side, y in (("left", 0.3), ("right", -0.3))
}
ROVER = """
[rover]
mass = 30
centre_of_mass = [0.05, 0.0, 0.3]
gravity = "mars"
[rover.wheels]
front = { position = [0.4, 0.0] }
"rear left" = { position = [-0.4, 0.3] }
rear-right = { position = [-0.4, -0.3] }
"""


@pytest.mark.parametrize("degrees", [0.0, 12.0, 25.0])
def test_loads_balance_weight_and_moments(degrees):
    rover = WheeledRover(40.0, (0.08, 0.05, 0.35), SIX)
    slope = np.deg2rad(degrees)
    load = rover.loads(slope)
    x, y = np.asarray([(w.forward, w.left) for w in SIX.values()]).T
    weight = 40.0 * 9.80665
    assert load.sum() == pytest.approx(weight * np.cos(slope))
    # about the line through the middle of the frame, gravity acts 0.35 m above the ground
    assert load @ x == pytest.approx(weight * (0.08 * np.cos(slope) - 0.35 * np.sin(slope)))
    assert load @ y == pytest.approx(weight * 0.05 * np.cos(slope))


def test_loads_are_those_of_equal_springs_under_a_rigid_body():
    rover = WheeledRover(40.0, (0.08, 0.05, 0.35), SIX)
    places = np.asarray([(1.0, w.forward, w.left) for w in SIX.values()])
    load = rover.loads(0.2)
    plane, *_ = np.linalg.lstsq(places, load, rcond=None)  # compressions of springs lie in a plane
    assert places @ plane == pytest.approx(load)


def test_a_wheel_that_leaves_the_ground_is_named():
    tall = WheeledRover(40.0, (0.0, 0.0, 1.0), {k: SIX[k] for k in SIX if "middle" not in k})
    with pytest.raises(InputError, match="the wheel front-left leaves the ground on a slope of 30"):
        tall.loads(np.deg2rad(30.0))
    # weight acts through the rear contacts, 0.4 m behind the middle, where it lies 1 m above
    tipping = tall.tipping_slope(1.0)
    assert np.tan(tipping) == pytest.approx(0.4, rel=0.002)
    tall.loads(tipping * 0.999)


def test_wheels_in_one_line_do_not_carry_a_moment():
    line = {"front": RoverWheel(0.4, 0.0), "rear": RoverWheel(-0.4, 0.0)}
    assert WheeledRover(10.0, (0.0, 0.0, 0.2), line).loads(0.0) == pytest.approx(49.03, abs=0.01)
    with pytest.raises(InputError, match="wheels in one line"):
        WheeledRover(10.0, (0.0, 0.1, 0.2), line).loads(0.0)


def test_wheels_behind_others_run_in_their_ruts():
    rover = WheeledRover(40.0, (0.0, 0.0, 0.3), SIX)
    passes = rover.pass_numbers(dict.fromkeys(SIX, 0.1))
    ends = ["front", "middle", "rear"]
    assert passes == {name: 1 + ends.index(name.split("-")[0]) for name in SIX}
    apart = replace(rover, wheels=SIX | {"rear-left": RoverWheel(-0.4, 0.45)})
    assert apart.pass_numbers(dict.fromkeys(SIX, 0.1))["rear-left"] == 1


def test_the_section_is_read_and_written_back(model_file):
    model_file.write_text(model_file.read_text() + ROVER)
    case = read_case(model_file)
    assert case.rover.gravity == 3.71
    assert case.rover.wheels["rear left"] == RoverWheel(-0.4, 0.3)
    model_file.write_text(case_as_toml(case))
    assert read_case(model_file).rover == case.rover


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("mass = 30", "mas = 30", "did you misspell it as 'mas'"),
        (ROVER, "[rover]\nradius = 0.1", "four equal wheels is for soilml paper climb"),
        ("mass = 30", "mass = -1", "mass is -1 kg; it must lie between 0.01 and 100000"),
        ("[0.05, 0.0, 0.3]", "[0.05, 0.3]", r"centre_of_mass is \[0.05, 0.3\]; needed is"),
        ("[0.05, 0.0, 0.3]", "[0.05, 0.0, 300]", "height. in m, up to 100"),
        ("[0.05, 0.0, 0.3]", "[0.05, 0.0, -0.3]", "height above the ground cannot be negative"),
        ('"mars"', '"venus"', "gravity is 'venus'; needed is a number in m/s.2, or one of earth"),
        ('"mars"', "981", "gravity is 981 m/s.2; it must lie between 0.01 and 30"),
        ("[0.4, 0.0] }", '[0.4, 0.0], gear = "lugged" }', "gear is 'lugged'; gears of this file"),
        ("[0.4, 0.0] }", "[0.4, 0.0], driven = false }", "unknown key 'driven'"),
        ("[0.4, 0.0] }", '["0.4", 0.0] }', "needed is .forward, left. in m"),
    ],
)
def test_what_is_wrong_is_told(model_file, old, new, said):
    model_file.write_text(model_file.read_text() + ROVER.replace(old, new))
    with pytest.raises(InputError, match=said):
        read_case(model_file)


def test_a_track_is_no_wheel_of_a_rover(model_file):
    text = model_file.read_text().replace('type = "wheel"', 'type = "track"\nbase = 0.5')
    model_file.write_text(text + ROVER)
    with pytest.raises(InputError, match=r"its gear is a track, but .rover. shares the load"):
        read_case(model_file)


def test_gravity_by_name_or_number():
    assert [read_gravity(g) for g in ("moon", "Earth", "1.35", 9.8)] == [1.62, 9.80665, 1.35, 9.8]
    with pytest.raises(InputError, match="needed is a number in m/s"):
        read_gravity("heavy")
