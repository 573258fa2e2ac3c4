"""The ROS 2 node with real message definitions and stand-ins for the libraries of ROS."""

import sys
from types import SimpleNamespace

import numpy as np
import pytest
from ros2_messages import GIVEN, SECOND, MessageStore, contents, drive, loaded_node

pytest.importorskip("rosbags")


@pytest.fixture(scope="module")
def store():
    return MessageStore()


@pytest.fixture
def node_module(monkeypatch, store):
    """A function that loads the module of the node with the given parameters."""
    return lambda **given: loaded_node(monkeypatch, store, "node", GIVEN | given)


def header(store, stamp):
    seconds, nanoseconds = divmod(stamp, SECOND)
    time = store.of("builtin_interfaces", "Time", sec=seconds, nanosec=nanoseconds)
    return store.of("std_msgs", "Header", stamp=time)


def messages(store, rows):
    """Messages of a drive after serialisation, each with its topic and type."""
    for _, (kind, stamp, *parts) in contents(rows):
        head = header(store, stamp)
        if kind == "joints":
            names, velocity, effort = parts
            fields = {"name": names, "velocity": np.array(velocity), "effort": np.array(effort)}
            message = store.of("sensor_msgs", "JointState", header=head, **fields)
            yield "joint_states", "sensor_msgs/msg/JointState", stamp, message
        else:
            message = store.of("nav_msgs", "Odometry", header=head)
            message.twist.twist.linear.x, message.twist.twist.angular.z = parts
            yield "odom", "nav_msgs/msg/Odometry", stamp, message


def test_it_passes_messages_on(node_module, store):
    node = node_module().SoilNode()
    for topic, kind, _, message in messages(store, drive(5)):
        node.callbacks[topic](store.again(message, kind))
    node.callbacks["timer"]()
    kind = "diagnostic_msgs/msg/DiagnosticArray"
    soil = [store.again(message, kind) for message in node.published["soil"]]
    assert [m.header.stamp.sec for m in soil] == [101, 102, 103, 104]
    (status,) = soil[-1].status
    values = {pair.key: pair.value for pair in status.values}
    assert values["event"] == "ACCEPTED" and float(values["rows_remembered"]) == 4
    assert status.hardware_id == "wheel_joint"
    (health,) = (store.again(message, kind) for message in node.published["/diagnostics"])
    assert [s.name for s in health.status] == ["soil_estimator: inputs", "soil_estimator: soil"]
    assert health.status[0].level == health.status[0].OK
    assert node.callbacks["~/restart"](None, SimpleNamespace()).success
    node.callbacks["timer"]()
    assert "no row" in node.published["/diagnostics"][-1].status[1].message
    assert "wheel_load" not in node.callbacks and "load=60.0" in node.lines[0]


def test_a_recorded_bag_gives_the_rows_of_its_drive(node_module, store, tmp_path):
    from rosbags.highlevel import AnyReader
    from rosbags.rosbag2 import Writer

    with Writer(tmp_path / "bag", version=9) as bag:
        connections = {}
        for topic, kind, stamp, message in messages(store, drive(60)):
            if topic not in connections:
                connections[topic] = bag.add_connection(topic, kind, typestore=store.types)
            raw = store.types.serialize_cdr(message, kind)
            bag.write(connections[topic], stamp + (SECOND if topic == "odom" else 0), raw)
    node = node_module().SoilNode()
    with AnyReader([tmp_path / "bag"], default_typestore=store.types) as bag:
        for connection, _, raw in bag.messages():
            node.callbacks[connection.topic](bag.deserialize(raw, connection.msgtype))
    stamps = [message.header.stamp.sec for message in node.published["soil"]]
    assert stamps == list(range(101, 160))


def test_a_wrong_parameter_ends_it_with_one_line(node_module, capsys):
    assert node_module(joint=None).main() == 2
    told = capsys.readouterr().err
    assert told.startswith("soil_estimator: the parameter joint is missing: name of the wheel's")
    assert told.count("\n") == 1
    assert node_module().main() == 0


def test_the_rows_are_kept_when_it_ends(node_module, store, tmp_path, monkeypatch):
    path = tmp_path / "state.npz"
    module = node_module(state_file=str(path))

    def spin(node):
        for topic, kind, _, message in messages(store, drive(5)):
            node.callbacks[topic](store.again(message, kind))
        raise KeyboardInterrupt

    monkeypatch.setattr(sys.modules["rclpy"], "spin", spin, raising=False)
    assert module.main() == 0 and path.exists()
    assert module.SoilNode().lines[1].startswith("4 rows are restored")
