"""The ROS 2 example: its logic by itself, and its node with stand-ins for the libraries of ROS."""

import importlib
import sys
import types
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from soilml import Estimator, Model, Operating, Wheel, soil

ROOT = Path(__file__).parents[1]
RADIUS, LOAD = 0.15, 60.0


@pytest.fixture(autouse=True)
def example(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "examples" / "ros2"))
    yield
    for name in [n for n in sys.modules if n.split(".")[0] == "soil_estimator"]:
        del sys.modules[name]


def module(name):
    return importlib.import_module(f"soil_estimator.{name}")


def drive(slips):
    """Samples of ten seconds at each slip, twenty a second: time, wheel speed, torque, speed."""
    force = Model(Wheel(radius=RADIUS, width=0.12))(
        soil("wong1989/dry_sand"), Operating(slip=np.asarray(slips), load=LOAD)
    )
    rng, time = np.random.default_rng(0), 0.0
    for slip, torque in zip(slips, force.torque, strict=True):
        for _ in range(20):
            noise = 1.0 + 0.02 * rng.normal(size=2)
            yield time, 1.0 * noise[0], torque * noise[1], RADIUS * (1.0 - slip)
            time += 0.05


def test_rows_are_means_of_a_stretch():
    rows = module("rows").RowCollector(RADIUS, LOAD, period=1.0)
    assert rows.add(0.0, {"wheel_speed": 1.0, "torque": 2.0}) is None
    assert rows.add(0.5, {"wheel_speed": 3.0, "torque": 4.0, "speed": 0.15}) is None
    row = rows.add(1.1, {"speed": 0.15})
    assert row == pytest.approx({"slip": 0.5, "torque": 3.0, "load": LOAD})


@pytest.mark.parametrize(
    "samples",
    [
        {"wheel_speed": 0.0, "torque": 1.0, "speed": 0.1},
        {"wheel_speed": 1.0, "torque": 1.0, "speed": 0.0},
        {"wheel_speed": 1.0, "torque": 1.0},
        {"wheel_speed": 1.0, "torque": float("nan"), "speed": 0.1},
    ],
    ids=["wheel stands", "rover stands", "no odometry", "no torque"],
)
def test_a_stretch_that_says_nothing_gives_no_row(samples):
    rows = module("rows").RowCollector(RADIUS, LOAD)
    rows.add(0.0, samples)
    assert rows.add(1.0, samples) is None


def test_a_clock_that_jumps_back_begins_again():
    rows = module("rows").RowCollector(RADIUS, LOAD)
    good = {"wheel_speed": 1.0, "torque": 1.0, "speed": 0.1}
    rows.add(100.0, good)
    assert rows.add(0.0, good) is None
    assert rows.add(1.0, good) is not None


def test_slip_of_driving_and_braking_wheels():
    slip_of = module("slip").slip_of
    assert slip_of(0.2, 0.15) == pytest.approx(0.25)
    assert slip_of(0.15, 0.2) == pytest.approx(-0.25)


def logic():
    estimator = Estimator.load(ROOT / "exported" / "wheel.onnx")
    return module("logic").SoilLogic(estimator, module("rows").RowCollector(RADIUS, LOAD))


def reports(own, slips):
    found = []
    for time, wheel_speed, torque, speed in drive(slips):
        found.append(own.add(time, wheel_speed=wheel_speed, torque=torque))
        found.append(own.add(time, speed=speed))
    return [report for report in found if report is not None]


def test_a_drive_over_sand_is_recognised():
    found = reports(logic(), np.linspace(0.08, 0.55, 12))
    last = found[-1]
    assert len(found) == 11 and last.sound and last.values["rows"] == 11
    truth = float(soil("wong1989/dry_sand").friction_angle)
    std = last.values["friction_angle_std"]
    assert abs(last.values["friction_angle"] - truth) < 3.0 * std < 0.3


def test_restart_forgets_and_bad_rows_are_told():
    own = logic()
    reports(own, [0.1, 0.2, 0.3])
    own.restart()
    (report,) = reports(own, [0.2, 0.3])
    assert report.values["rows"] == 1
    own.add(100.0, wheel_speed=1.0, torque=2.0, speed=0.1, load=-5.0)
    refused = own.add(101.0, speed=0.1)
    assert not refused.sound and "load is -5" in refused.message


class FakeNode:
    """What the node uses of rclpy.node.Node."""

    def __init__(self, name):
        self.callbacks, self.published = {}, []

    def declare_parameter(self, name, default):
        model = str(ROOT / "exported" / "wheel.onnx")
        return SimpleNamespace(value=model if name == "model" else default)

    def create_publisher(self, kind, topic, depth):
        return SimpleNamespace(publish=self.published.append)

    def create_subscription(self, kind, topic, callback, depth):
        self.callbacks[topic] = callback

    def create_service(self, kind, name, callback):
        self.callbacks[name] = callback


class FakeMessage:
    """A message with whatever fields are set."""

    OK, WARN = 0, 1

    def __init__(self, **fields):
        self.header = SimpleNamespace(stamp=None)
        self.__dict__.update(fields)


def test_the_node_passes_messages_on(monkeypatch):
    kinds = {
        "diagnostic_msgs.msg": ["DiagnosticArray", "DiagnosticStatus", "KeyValue"],
        "geometry_msgs.msg": ["WrenchStamped"],
        "nav_msgs.msg": ["Odometry"],
        "sensor_msgs.msg": ["JointState"],
        "std_srvs.srv": [],
        "rclpy.node": [],
    }
    for path, names in kinds.items():
        parent = types.ModuleType(path.partition(".")[0])
        made = types.ModuleType(path)
        for name in names:
            setattr(made, name, FakeMessage)
        monkeypatch.setitem(sys.modules, parent.__name__, parent)
        monkeypatch.setitem(sys.modules, path, made)
    sys.modules["rclpy.node"].Node = FakeNode
    service = SimpleNamespace(Request=FakeMessage, Response=FakeMessage)
    sys.modules["std_srvs.srv"].Trigger = service
    node = module("node").SoilNode()
    for time, wheel_speed, torque, speed in drive([0.1, 0.25, 0.4]):
        stamp = SimpleNamespace(sec=int(time), nanosec=int(time % 1.0 * 1e9))
        header = SimpleNamespace(stamp=stamp)
        twist = SimpleNamespace(twist=SimpleNamespace(linear=SimpleNamespace(x=speed)))
        node.callbacks["joint_states"](
            FakeMessage(
                header=header,
                name=["other", "wheel_joint"],
                velocity=[9.0, wheel_speed],
                effort=[9.0, torque],
            )
        )
        node.callbacks["odom"](FakeMessage(header=header, twist=twist))
    assert len(node.published) == 2
    (status,) = node.published[-1].status
    values = {pair.key: float(pair.value) for pair in status.values}
    assert status.level == FakeMessage.OK and values["rows"] == 2
    assert node.callbacks["~/restart"](None, FakeMessage()).success
