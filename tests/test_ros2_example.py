"""What the ROS 2 example does without ROS: messages of all kinds in, rows and reports out."""

import math
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from ros2_messages import GIVEN, LOAD, MODEL, ROOT, SAND, SECOND, contents, drive, play

from soilml import Estimator
from soilml.errors import InputError, ModelFileError

sys.path.insert(0, str(ROOT / "examples" / "ros2"))

from soil_estimator.logic import Level, SoilLogic
from soil_estimator.settings import settings_of

#: Rows of a drive of a minute: the last stretch is not known to be complete.
WHOLE = 59


@pytest.fixture(autouse=True, scope="module")
def loaded_once():
    """A model file is loaded once, not for each of these tests."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Estimator, "load", staticmethod(cache(Estimator.load)))
        yield


def logic(**given):
    return SoilLogic(settings_of(GIVEN | given))


def rows_of(reports):
    names = ("row_slip", "row_torque")
    return np.asarray([[r.stamp, *(r.values[name] for name in names)] for r in reports])


@pytest.fixture(scope="module")
def prompt():
    """Reports of a drive of a minute whose messages arrive at once."""
    return play(logic(), contents(drive()))


def test_a_drive_over_sand_is_recognised(prompt):
    assert len(prompt) == WHOLE == len({report.stamp for report in prompt})
    last, known = prompt[-1], SAND
    assert last.level is Level.OK and last.values["rows_remembered"] >= WHOLE - 1
    for name in ("cohesion", "friction_angle"):
        error = last.values[name] - float(getattr(known, name))
        assert abs(error) < 3.0 * last.values[f"{name}_std"]
        assert last.values[f"{name}_low"] < last.values[name] < last.values[f"{name}_high"]


def test_messages_that_wait_on_the_way_and_come_twice_give_the_same_rows(prompt):
    rng, ready, mixed = np.random.default_rng(0), {"joints": 0.0, "odometry": 0.0}, []
    for at, (kind, *parts) in contents(drive()):
        # each topic keeps its order, as in ROS
        ready[kind] = max(ready[kind], at + rng.exponential(0.2))
        mixed += [(ready[kind], (kind, *parts))] * 2
    mixed.sort(key=lambda each: each[0])
    own = logic()
    assert np.array_equal(rows_of(play(own, mixed)), rows_of(prompt))
    assert own.inputs(160.0).values["repeated_stamps"] > 500


def test_fields_that_are_missing_are_no_samples():
    own = logic()
    for at, (kind, *parts) in contents(drive(20)):
        if kind == "joints":
            stamp, names, speed, effort = parts
            # speed and effort in messages of their own, in another order and with other joints
            turned = [names[::-1], speed[::-1], effort[::-1]]
            own.on_joints(stamp, turned[0], turned[1], [], at)
            own.on_joints(stamp, turned[0], [], turned[2], at)
            own.on_joints(stamp, ["other"], [7.0], [7.0], at)
            own.on_joints(stamp, names, speed[:1], [math.nan] * 2, at)
        else:
            own.on_odometry(*parts, at)
    assert own.soil().values["rows_accepted"] == 19
    own = logic()
    for at, (kind, *parts) in contents(drive(20)):
        parts = [*parts[:-1], []] if kind == "joints" else parts
        assert play(own, [(at, (kind, *parts))]) == []
    told = own.inputs(120.0)
    assert told.level is Level.ERROR and told.message == "no effort of the joint since the start"


def test_what_does_not_arrive_is_told():
    own = logic()
    assert own.inputs(100.0).level is Level.OK  # has just begun to wait
    assert own.inputs(104.0).message == "no velocity of the joint since the start"
    own.on_joints(SECOND, ["left", "right"], [], [], 105.0)
    assert (
        "no joint wheel_joint in joint_states, which has left, right" in own.inputs(106.0).message
    )
    own = logic()
    play(own, contents(drive(10)))
    assert own.inputs(110.0).level is Level.OK
    assert own.inputs(120.0).message == "no velocity of the joint for 10.1 s"


@pytest.mark.parametrize("fault", ["torque", "speed", "silent"])
def test_after_a_fault_of_a_sensor_it_recovers_by_itself(fault):
    own = logic()
    found = []
    for at, (kind, stamp, *parts) in contents(drive(60)):
        if 120.0 <= at < 130.0:
            if kind == "joints" and fault == "torque":
                parts[2] = [9.0, 2.5]
            if kind == "odometry" and fault == "speed":
                parts[0] = 0.02
            if kind == "odometry" and fault == "silent":
                continue
        found += play(own, [(at, (kind, stamp, *parts))])
    assert found[-1].values["in_range"] == 1.0
    during = [r for r in found if 122 * SECOND < r.stamp <= 130 * SECOND]
    assert not [r for r in during if r.values["event"] == "ACCEPTED"]
    late = [r.values["event"] for r in found if r.stamp > 140 * SECOND]
    assert late.count("ACCEPTED") >= len(late) - 1


def test_a_bag_that_is_played_three_times_counts_once(prompt):
    """Also where odometry is late, so that its last messages come after the clock was set back."""
    own, found = logic(), []
    for loop in range(3):
        for at, content in contents(drive(20), 0.3):
            found += play(own, [(at + 21.0 * loop, content)])
    assert len(found) >= 3 * 18
    assert found[-1].values["event"] == "REPEATED" and found[-1].level is Level.OK
    # a stretch at the seam may be cut differently
    assert found[-1].values["rows_remembered"] <= 21
    assert found[-1].values["friction_angle_std"] > 0.9 * found[18].values["friction_angle_std"]


def test_single_wrong_stamps_change_nothing(prompt):
    messages = contents(drive())
    wrong = []
    for i, (at, (kind, stamp, *parts)) in enumerate(messages):
        wrong.append((at, (kind, stamp, *parts)))
        if i % 50 == 25:
            wrong.append((at, (kind, (0, -5, 10**18, stamp + 10**10)[i // 50 % 4], *parts)))
    own = logic()
    assert np.array_equal(rows_of(play(own, wrong)), rows_of(prompt))
    values = own.inputs(160.0).values
    assert values["messages_without_stamp"] + values["doubtful_stamps"] == len(messages) // 50
    assert values["clocks_set"] == 0


def test_load_from_its_topic_and_a_wheel_beside_the_centre():
    own, found = logic(load="topic", wheel_y=0.5, joint_sign=-1.0), []
    for at, (kind, stamp, *parts) in contents(drive(10)):
        if kind == "joints":
            names, speed, effort = parts
            parts = [names, [-v for v in speed], [-v for v in effort]]
            found += own.on_load(stamp, LOAD + 2.0, at)
        else:
            parts = [parts[0] + 0.5 * 0.1, 0.1]
        found += play(own, [(at, (kind, stamp, *parts))])
    plain = play(logic(), contents(drive(10)))
    assert rows_of(found) == pytest.approx(rows_of(plain))
    assert {report.values["row_load"] for report in found} == {LOAD + 2.0}


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"load": "60"}, "the parameter load is '60'; needed is a number in N, or 'topic'"),
        ({"load": -1.0}, "the parameter load is -1; it must be above zero"),
        ({"load": True}, "the parameter load is True; needed"),
        ({"wheel_radius": 0.2}, "the parameter wheel_radius is 0.2; .* for a wheel of 0.15 m"),
        ({"wheel_radius": math.nan}, "the parameter wheel_radius is nan; needed"),
        ({"torque_noise": 0.02}, "the parameter torque_noise is 0.02; needed"),
        ({"torque_noise": [0.0, 0.0]}, "a sensor has noise above zero"),
        ({"slip_noise": [-0.1, 0.0]}, "a sensor has noise above zero"),
        ({"joint": ""}, "the parameter joint is empty"),
        ({"joint": 3}, "the parameter joint is 3; needed"),
        ({"joint_sign": 2.0}, "joint_sign is 2; it is 1 or -1"),
        ({"period": 0.0}, "the parameter period is 0; it must be above zero"),
        ({"period": 1e300}, r"period is 1e\+300 s; needed is a time above zero, a day at most"),
        ({"patience": 1e305}, r"patience is 1e\+305 s; needed is a time above zero, a day at most"),
        ({"length": 5}, "the parameter length is 5; needed is a whole number"),
        ({"state_file": "/nowhere/rows.npz"}, "state_file is /nowhere/rows.npz; needed is a file"),
        ({"state_file": "/tmp"}, "state_file is /tmp; needed is a file in a folder that exists"),
        ({"n": 1.1}, "'n' is not a context input of this file"),
    ],
)
def test_each_wrong_parameter_is_named_in_one_line(given, message):
    with pytest.raises(InputError, match=message) as caught:
        settings_of(GIVEN | given)
    assert "\n" not in str(caught.value)


def test_a_file_for_many_wheels_needs_the_wheel_and_the_soil():
    many = GIVEN | {"model": str(ROOT / "exported" / "any_wheel.onnx"), "wheel_width": 0.12}
    with pytest.raises(InputError, match="the parameter bearing_modulus is missing: kc / width"):
        settings_of(many)
    many |= {"bearing_modulus": 1536680.0, "n": 1.1, "bearing_std": 0.2, "cohesion_max": 3000.0}
    own = settings_of(many | {"shear_modulus_max": 0.03})
    assert len(play(SoilLogic(own), contents(drive(10)))) == 9
    with pytest.raises(ModelFileError):
        settings_of(GIVEN | {"model": "/nowhere.onnx"})


def test_rows_are_kept_in_the_state_file(tmp_path):
    path = tmp_path / "state.npz"
    own = logic(state_file=str(path))
    play(own, contents(drive(10)))
    own.save()
    again = logic(state_file=str(path))
    assert again.remark.startswith("9 rows are restored from")
    assert again.soil().values["rows_remembered"] == 9.0
    other = logic(state_file=str(path), torque_noise=[0.1, 0.02], length=200)
    assert "is not used" in other.remark
    for damaged in (b"", b"PK\x03\x04 nothing", b"\x93NUMPY"):
        path.write_bytes(damaged)
        assert "is not used" in logic(state_file=str(path)).remark
    assert logic().remark == "" and Path(MODEL).exists()


def test_the_state_is_written_as_the_rover_goes(tmp_path):
    """Once a stop without notice lost the rows of the whole drive."""
    path = tmp_path / "rows.npz"
    own = logic(state_file=str(path), save_every=4.0)
    assert not path.exists()
    counts = []
    for message in contents(drive(20)):
        if play(own, [message]):
            counts.append(logic(state_file=str(path)).soil().values["rows_remembered"])
    assert counts[:6] == [1, 1, 1, 1, 5, 5] and counts[-1] >= 15
    assert [file.name for file in tmp_path.iterdir()] == ["rows.npz"]
    own.restart()
    assert logic(state_file=str(path)).soil().values["rows_remembered"] == 0


def test_a_state_that_cannot_be_written_is_told_and_the_drive_goes_on(tmp_path):
    folder = tmp_path / "state"
    folder.mkdir()
    own = logic(state_file=str(folder / "rows.npz"), save_every=1.0)
    folder.rmdir()
    assert len(play(own, contents(drive(10)))) == 9
    told = own.soil()
    assert told.level is Level.WARN
    assert told.message.endswith("; state_file cannot be written: No such file or directory")
    folder.mkdir()
    play(own, contents(drive(10, begin=110)))
    assert own.soil().level is Level.OK
