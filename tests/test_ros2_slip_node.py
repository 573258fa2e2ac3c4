"""The ROS 2 node that publishes a speed without odometry, with real message definitions."""

from types import SimpleNamespace

import numpy as np
import pytest
from ros2_messages import ROOT, SECOND, MessageStore, loaded_node

from soilml import read_case, read_table
from soilml.cli import main
from soilml.onboard.slip_stream import SlipStream
from soilml.slip_filter.drive import read_drive

pytest.importorskip("rosbags")
SLIP = ROOT / "examples" / "slip"
JOINTS = ["fl", "fr", "rl", "rr"]
RADIUS, RATE = 0.15, 5
TWIST = "geometry_msgs/msg/TwistWithCovarianceStamped"


@pytest.fixture(scope="module")
def store():
    return MessageStore()


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    file = str(tmp_path_factory.mktemp("slip_node") / "rover.onnx")
    assert main(["export", "slip", str(SLIP / "rover.toml"), file, "--draws", "128"]) == 0
    return file


@pytest.fixture
def node_module(monkeypatch, store, model):
    """A function that loads the module of the node with the given parameters."""
    usual = {"model": model, "joints": JOINTS, "wheel_radius": RADIUS}
    return lambda **given: loaded_node(monkeypatch, store, "slip_node", usual | given)


@pytest.fixture(scope="module")
def drive():
    case = read_case(SLIP / "rover.toml")
    return read_drive(read_table(SLIP / "drive.csv"), case)


def messages(store, drive, rows, begin=100):
    """Joint states and attitudes of some rows of a drive, `RATE` a second, serialised once."""
    for number, i in enumerate(rows):
        for k in range(RATE):
            at = begin * SECOND + number * SECOND + k * SECOND // RATE
            seconds, nanoseconds = divmod(at, SECOND)
            time = store.of("builtin_interfaces", "Time", sec=seconds, nanosec=nanoseconds)
            head = store.of("std_msgs", "Header", stamp=time)
            fields = {
                "name": ["arm", *JOINTS],
                "velocity": np.append(9.0, drive.rim_speed[i] / RADIUS),
                "effort": np.append(9.0, drive.torque[i]),
            }
            joints = store.of("sensor_msgs", "JointState", header=head, **fields)
            yield "joint_states", store.again(joints, "sensor_msgs/msg/JointState")
            imu = store.of("sensor_msgs", "Imu", header=head)
            # uphill is a negative rotation about y, which points to the left
            imu.orientation.y = float(np.sin(-0.5 * drive.slope[i]))
            imu.orientation.w = float(np.cos(0.5 * drive.slope[i]))
            yield "imu", store.again(imu, "sensor_msgs/msg/Imu")


def play(node, messages):
    for topic, message in messages:
        node.callbacks[topic](message)


def test_its_twists_are_those_of_the_stream(node_module, store, drive, model):
    node, rows = node_module().SlipNode(), range(45, 65)
    play(node, messages(store, drive, rows))
    twists = [store.again(message, TWIST) for message in node.published["slip_twist"]]
    assert [t.header.stamp.sec for t in twists] == list(range(101, 120))
    assert twists[0].header.frame_id == "base_link"
    stream = SlipStream.load(model)
    state = stream.start()
    for i, twist in zip(rows, twists, strict=False):
        load = stream.loads(float(drive.slope[i]))
        row = drive.rim_speed[i], drive.torque[i], load, float(drive.slope[i])
        found, state = stream.step(state, *row)
        assert twist.twist.twist.linear.x == pytest.approx(found.speed, rel=1e-4)
        covariance = np.reshape(twist.twist.covariance, (6, 6))
        assert covariance[0, 0] == pytest.approx(found.speed_std**2, rel=1e-3)
        # what is not estimated is left to other sensors of the filter
        assert np.diag(covariance)[1:].min() > 1e5 and np.all(
            covariance == np.diag(covariance.diagonal())
        )


@pytest.mark.parametrize(
    ("field", "flag", "answered"),
    [("torque", "torque-set-aside", True), ("rim_speed", "row-not-possible", False)],
)
def test_a_wild_reading_is_flagged_and_the_next_rows_are_answered(
    node_module, store, drive, field, flag, answered
):
    """The twists that follow were not a number, and called determined, until the node was started
    again."""
    node = node_module().SlipNode()
    play(node, messages(store, drive, range(45, 50)))
    wild = SimpleNamespace(rim_speed=drive.rim_speed, torque=drive.torque, slope=drive.slope)
    setattr(wild, field, np.where(np.arange(4) == 1, 1e20, getattr(drive, field)))
    play(node, messages(store, wild, range(50, 52), begin=105))
    play(node, messages(store, drive, range(52, 60), begin=107))
    told = [message.status[0].message.split(", ") for message in node.published["slip_flags"]]
    assert [flag in flags for flags in told[5:8]] == [True, True, False]
    twists = [message.twist for message in node.published["slip_twist"]]
    assert len(twists) == len(told) - (0 if answered else 2)
    for twist in twists:
        assert np.isfinite([twist.twist.linear.x, *twist.covariance]).all()
