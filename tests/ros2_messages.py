"""Drives as messages of ROS 2, and stand-ins for its libraries."""

from __future__ import annotations

import importlib
import sys
import types
from pathlib import Path
from types import MappingProxyType, SimpleNamespace

import numpy as np

from soilml import Model, Operating, Wheel, soil

ROOT = Path(__file__).parents[1]
MODEL = str(ROOT / "exported" / "wheel.onnx")
RADIUS, WIDTH, LOAD, SECOND = 0.15, 0.12, 60.0, 10**9
SAND = soil("wong1989/dry_sand")
#: Parameters of the node for the drives of this file.
GIVEN = {
    "model": MODEL,
    "joint": "wheel_joint",
    "wheel_radius": RADIUS,
    "wheel_y": 0.0,
    "load": LOAD,
    "torque_noise": [0.0, 0.02],
    "slip_noise": [0.01, 0.0],
    "load_noise": [0.0, 0.0],
}
KINDS = {
    "diagnostic_msgs": ("DiagnosticArray", "DiagnosticStatus", "KeyValue"),
    "geometry_msgs": ("TwistWithCovarianceStamped", "WrenchStamped"),
    "nav_msgs": ("Odometry",),
    "sensor_msgs": ("Imu", "JointState"),
}


def drive(seconds=60, sand=SAND, rate=10, begin=100, seed=0):
    """Stamp (ns), wheel speed, torque and speed of the rover, `rate` times a second."""
    rng = np.random.default_rng(seed)
    slip = np.clip(0.3 + 0.22 * np.sin(0.7 * np.arange(seconds) + seed), 0.06, 0.58)
    wheel = Model(Wheel(radius=RADIUS, width=WIDTH))
    torque = wheel(sand, Operating(slip=slip, load=LOAD)).torque
    for i in range(seconds * rate):
        noise, k = 1.0 + 0.02 * rng.standard_normal(3), i // rate
        stamp = begin * SECOND + i * SECOND // rate
        yield stamp, noise[0], torque[k] * noise[1], RADIUS * (1.0 - slip[k]) * noise[2]


def joint_content(stamp, speed, torque):
    return "joints", stamp, ["other", "wheel_joint"], [9.0, speed], [9.0, torque]


def contents(rows, delay=0.0, odometry_every=1):
    """What messages say in the order of their arrival, odometry later by `delay` seconds."""
    found = []
    for i, (stamp, speed, torque, rover) in enumerate(rows):
        found.append((stamp, 0, joint_content(stamp, speed, torque)))
        if i % odometry_every == 0:
            at = stamp + round(delay * SECOND)
            found.append((at, 1, ("odometry", stamp, rover, 0.0)))
    found.sort(key=lambda each: each[:2])
    return [(at / SECOND, content) for at, _, content in found]


def play(logic, messages):
    """Reports of a `SoilLogic` on what messages say, each with its arrival."""
    found = []
    for at, (kind, *parts) in messages:
        found += getattr(logic, f"on_{kind}")(*parts, at)
    return found


class FakeNode:
    """What the node uses of rclpy.node.Node; parameters are those of `given`."""

    given = MappingProxyType(GIVEN)
    namespace = ""

    def __init__(self, name):
        self.name, self.callbacks, self.published, self.lines = name, {}, {}, []

    def get_name(self):
        return self.name

    def get_fully_qualified_name(self):
        return f"{self.namespace}/{self.name}"

    def get_logger(self):
        return SimpleNamespace(info=self.lines.append, warning=self.lines.append)

    def get_clock(self):
        now = SimpleNamespace(to_msg=lambda: sys.modules["stored"].of("builtin_interfaces", "Time"))
        return SimpleNamespace(now=lambda: now)

    def declare_parameter(self, name, value, descriptor):
        assert descriptor.dynamic_typing and descriptor.description
        return SimpleNamespace(value=self.given.get(name, value))

    def create_publisher(self, kind, topic, depth):
        found = self.published.setdefault(topic, [])
        return SimpleNamespace(publish=found.append)

    def create_subscription(self, kind, topic, callback, quality):
        self.callbacks[topic] = callback

    def create_service(self, kind, name, callback):
        self.callbacks[name] = callback

    def create_timer(self, period, callback):
        self.callbacks["timer"] = callback

    def destroy_node(self):
        self.callbacks = {}


class MessageStore:
    """Messages of ROS 2 Humble by rosbags, made without arguments as those of rclpy."""

    def __init__(self):
        from rosbags.typesys import Stores, get_typestore

        self.types = get_typestore(Stores.ROS2_HUMBLE)

    def of(self, package, name, /, **given):
        """A message with its defaults."""
        return self._made(f"{package}/msg/{name}", given)

    def kind(self, package, name):
        """A class of messages."""
        own, full = self, f"{package}/msg/{name}"
        parent = self.types.types[full]

        def begin(self, **given):
            parent.__init__(self, **vars(own._made(full, given)))

        return type(name, (parent,), {"__init__": begin})

    def again(self, message, full):
        """A message after serialisation, as a subscriber has it."""
        return self.types.deserialize_cdr(self.types.serialize_cdr(message, full), full)

    def _made(self, full, given):
        fields = self.types.fielddefs[full][1]
        return self.types.types[full](**{n: self._default(k) for n, k in fields} | given)

    def _default(self, described):
        kind, detail = int(described[0]), described[1]
        if kind == 1:
            return "" if detail[0] == "string" else 0.0 if "float" in detail[0] else 0
        if kind == 2:
            return self._made(detail, {})
        if kind == 3:
            return np.zeros(detail[1])
        return [] if detail[0][1][0] == "string" or int(detail[0][0]) == 2 else np.zeros(0)


def put_stand_ins(monkeypatch, store, given):
    """Put stand-ins for the libraries of ROS 2 in place of them."""

    def put(path, **content):
        made = types.ModuleType(path)
        vars(made).update(content)
        parent = path.partition(".")[0]
        if parent not in sys.modules:
            monkeypatch.setitem(sys.modules, parent, types.ModuleType(parent))
        monkeypatch.setitem(sys.modules, path, made)
        return made

    for package, names in KINDS.items():
        put(f"{package}.msg", **{name: store.kind(package, name) for name in names})
    node = type("GivenNode", (FakeNode,), {"given": given})
    put("rclpy", init=lambda: None, try_shutdown=lambda: None, spin=lambda _: None)
    put("rclpy.node", Node=node)
    put("rclpy.executors", ExternalShutdownException=type("Shutdown", (Exception,), {}))
    put("rclpy.qos", qos_profile_sensor_data=object())
    put("rcl_interfaces.msg", ParameterDescriptor=lambda **parts: SimpleNamespace(**parts))
    put("std_srvs.srv", Trigger=SimpleNamespace(Request=object, Response=object))
    put("stored", of=store.of)


def loaded_node(monkeypatch, store, name, given):
    """The module of a node, freshly loaded with the given parameters."""
    monkeypatch.syspath_prepend(str(ROOT / "examples" / "ros2"))
    put_stand_ins(monkeypatch, store, given)
    module = f"soil_estimator.{name}"
    monkeypatch.delitem(sys.modules, module, raising=False)
    loaded = importlib.import_module(module)
    monkeypatch.delitem(sys.modules, module)
    return loaded
