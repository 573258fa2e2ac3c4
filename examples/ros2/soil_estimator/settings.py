"""Parameters of the node, and what it makes of them."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from math import isclose, isfinite
from numbers import Real
from pathlib import Path
from typing import Any

from soilml import Estimator
from soilml.errors import InputError

#: Load is read of the topic `wheel_load` where the parameter `load` is this word.
TOPIC = "topic"
#: Parameters without a default: the node does not start without them.
REQUIRED = {
    "model": "path of a model file with a set posterior, or the short name of a released one",
    "joint": "name of the wheel's joint in joint_states",
    "wheel_radius": "radius of the wheel, m",
    "wheel_y": "distance of the wheel to the left of the point that odometry follows, m",
    "load": f"load on the wheel, N, or '{TOPIC}': force.z of the topic wheel_load",
    "torque_noise": "standard deviation of a row's torque: [constant in N m, share of the reading]",
    "slip_noise": "the same of its slip: [constant, share]",
    "load_noise": "the same of its load: [constant in N, share]",
}
#: Parameters with a default, which the node prints when it starts.
DEFAULTS: dict[str, tuple[str, Any]] = {
    "joint_sign": ("-1.0 where a positive velocity of the joint drives the rover backward", 1.0),
    "period": ("time of the stamps that makes a row, s", 1.0),
    "patience": ("longest wait for late messages, s", 2.0),
    "least_speed": ("speed of the rim below which the wheel stands, m/s", 0.005),
    "length": ("rows that are remembered", 100),
    "state_file": ("file in which the rows are kept; empty: none", ""),
    "save_every": ("time between two writings of state_file, s", 10.0),
}
#: Parameters that a file for many wheels needs, and no other file takes.
CONTEXT = {
    "wheel_width": "width of the wheel, m",
    "bearing_modulus": "kc / width + kphi, N/m^(n+2)",
    "n": "exponent of sinkage",
    "bearing_std": "standard deviation of the logarithm of the bearing modulus",
    "cohesion_max": "upper end of the prior of cohesion, Pa",
    "shear_modulus_max": "upper end of the prior of the shear modulus, m",
}
PARAMETERS = REQUIRED | {name: text for name, (text, _) in DEFAULTS.items()} | CONTEXT
NOISE = {"torque_noise": "torque", "slip_noise": "slip", "load_noise": "load"}
POSITIVE = ("wheel_radius", "period", "patience", "least_speed", "save_every")
#: Longest period and patience, s: stamps of messages are whole nanoseconds.
LONGEST = 86400.0


@dataclass(frozen=True)
class NodeSettings:
    """Checked parameters. `load` is None where it is read of its topic."""

    estimator: Estimator
    joint: str
    wheel_radius: float
    wheel_y: float
    load: float | None
    joint_sign: float
    period: float
    patience: float
    least_speed: float
    length: int
    state_file: str
    save_every: float
    given: Mapping[str, Any]

    @property
    def text(self) -> str:
        """All parameters in one line."""
        return ", ".join(f"{name}={value}" for name, value in self.given.items())


def settings_of(given: Mapping[str, Any]) -> NodeSettings:
    """Settings from the values of `PARAMETERS`, None where one was not given.

    Raises `InputError`, or `ModelFileError` for the file, with one line that names the parameter.
    """
    values = {name: given.get(name) for name in PARAMETERS}
    for name, (_, default) in DEFAULTS.items():
        values[name] = default if values[name] is None else values[name]
    missing = [name for name in REQUIRED if values[name] is None]
    if missing:
        name = missing[0]
        raise InputError(f"the parameter {name} is missing: {REQUIRED[name]}")
    texts = {name: _text(name, values[name]) for name in ("model", "joint", "state_file")}
    for name in ("model", "joint"):
        if not texts[name]:
            raise InputError(f"the parameter {name} is empty; needed: {REQUIRED[name]}")
    number = {name: as_number(name, values[name]) for name in (*POSITIVE, "wheel_y", "joint_sign")}
    for name in POSITIVE:
        if number[name] <= 0.0:
            raise InputError(f"the parameter {name} is {number[name]:g}; it must be above zero")
    for name in ("period", "patience", "save_every"):
        check_time(name, number[name])
    if abs(number["joint_sign"]) != 1.0:
        raise InputError(f"the parameter joint_sign is {number['joint_sign']:g}; it is 1 or -1")
    length = values["length"]
    if isinstance(length, bool) or not isinstance(length, int) or length < 16:
        raise InputError(f"the parameter length is {length!r}; needed is a whole number from 16 on")
    if texts["state_file"]:
        _check_place(texts["state_file"])
    return NodeSettings(
        estimator=_estimator(texts["model"], values, number["wheel_radius"]),
        joint=texts["joint"],
        load=_load(values["load"]),
        length=length,
        state_file=texts["state_file"],
        given={name: value for name, value in values.items() if value is not None},
        **number,
    )


def _estimator(model: str, values: Mapping[str, Any], radius: float) -> Estimator:
    """The file, set to the wheel and the noise."""
    estimator = Estimator.load(model)
    if estimator.sets is None:
        raise InputError(f"{model} has no set posterior; train it with [set_posterior]")
    needed = estimator.sets.context_ranges
    context = {n: as_number(n, values[n]) for n in CONTEXT if values[n] is not None}
    if "wheel_radius" in needed:
        context["wheel_radius"] = radius
    missing = [name for name in needed if name not in context]
    if missing:
        text = CONTEXT.get(missing[0], "an input of this file")
        raise InputError(f"the parameter {missing[0]} is missing: {text}; {model} needs it")
    built_for = json.loads(estimator.metadata.get("gear", "{}")).get("radius")
    if built_for is not None and not isclose(built_for, radius, rel_tol=1e-3):
        raise InputError(
            f"the parameter wheel_radius is {radius:g}; {model} is for a wheel of {built_for:g} m"
        )
    noise = {channel: _noise(name, values[name]) for name, channel in NOISE.items()}
    return estimator.on(noise=noise, **context)


def check_time(name: str, seconds: float) -> None:
    """Raises `InputError` for a time that is not between 1 ns and a day."""
    if not 1e-9 <= seconds <= LONGEST:
        raise InputError(
            f"the parameter {name} is {seconds:g} s; needed is a time above zero, a day at most"
        )


def _check_place(state_file: str) -> None:
    """A file that cannot be written is told at the start, not when the rows are lost."""
    folder = Path(state_file).absolute().parent
    if Path(state_file).is_dir() or not os.access(folder, os.W_OK):
        raise InputError(
            f"the parameter state_file is {state_file}; needed is a file in a folder that exists "
            "and can be written"
        )


def _load(value: Any) -> float | None:
    if value == TOPIC:
        return None
    if isinstance(value, str):
        raise InputError(f"the parameter load is {value!r}; needed is a number in N, or '{TOPIC}'")
    number = as_number("load", value)
    if number <= 0.0:
        raise InputError(f"the parameter load is {number:g}; it must be above zero")
    return number


def _noise(name: str, value: Any) -> tuple[float, float]:
    if isinstance(value, str) or not hasattr(value, "__len__") or len(value) != 2:
        raise InputError(f"the parameter {name} is {value!r}; needed: {REQUIRED[name]}")
    constant, share = (as_number(name, part) for part in value)
    if min(constant, share) < 0.0 or (name == "torque_noise" and constant + share == 0.0):
        raise InputError(f"the parameter {name} is {value!r}; a sensor has noise above zero")
    return constant, share


def as_number(name: str, value: Any, needed: Mapping[str, str] = PARAMETERS) -> float:
    """A finite number; raises `InputError` with what is `needed`."""
    if isinstance(value, bool) or not isinstance(value, Real) or not isfinite(value):
        raise InputError(f"the parameter {name} is {value!r}; needed: {needed[name]}")
    return float(value)


def _text(name: str, value: Any) -> str:
    if not isinstance(value, str):
        raise InputError(f"the parameter {name} is {value!r}; needed: {PARAMETERS[name]}")
    return value
