"""Faults of readings: wrong units and wheels, sensor errors, unmodelled effects, mixed soils."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from soilml.config.case import Case
from soilml.parameters import declared
from soilml.physics.effects import EFFECTS
from soilml.physics.operating_point import Operating

Floats = np.ndarray[Any, np.dtype[np.float64]]
#: slip, load (N), torque (N m), sinkage (m), drawbar_pull (N): arrays of one shape.
Readings = dict[str, Floats]
Report = Callable[[Readings], Readings]
#: Operating conditions that some effects need: speed (m/s), pass in a rut, slip angle (rad).
EFFECT_CONDITIONS = {"speed": 0.2, "pass_number": 2.0, "slip_angle": 0.2}
#: Number of rows -> the groups of rows that share one soil.
Partition = Callable[[int], Sequence[slice]]


@dataclass(frozen=True)
class Fault:
    """A difference between the model of an estimator and reality, or the readings of it.

    `report` maps true readings to reported ones; `case` maps the nominal case to the true one.
    `partition` gives the rows that share one soil, where the fault is known; `mix_rows` combines
    the rows of a set with those of another set, both (sets, rows); `sinkage_only`: no other channel
    is affected.
    """

    group: str
    name: str
    report: Report = field(default=lambda r: r)
    case: Callable[[Case], Case] = field(default=lambda case: case)
    partition: Partition = field(default=lambda rows: (slice(0, rows),))
    mix_rows: Callable[[Readings, Readings], Readings] = field(default=lambda own, other: own)
    sinkage_only: bool = False


def _scaled(name: str, factor: float) -> Report:
    return lambda r: r | {name: factor * r[name]}


def _shifted(name: str, offset: float) -> Report:
    return lambda r: r | {name: r[name] + offset}


def _first_torque_doubled(own: Readings, other: Readings) -> Readings:
    first = np.arange(own["torque"].shape[-1]) == 0
    return own | {"torque": np.where(first, 2.0, 1.0) * own["torque"]}


def _half_of_another_soil(own: Readings, other: Readings) -> Readings:
    count = own["torque"].shape[-1]
    return {k: np.where(np.arange(count) < count // 2, v, other[k]) for k, v in own.items()}


def _with_wheel(key: str, factor: float) -> Callable[[Case], Case]:
    def true_case(case: Case) -> Case:
        gear: Any = case.model.gear
        return case.with_values({f"gear.{key}": factor * getattr(gear, key)})

    return true_case


def _with_effect(effect: Any) -> Callable[[Case], Case]:
    return lambda case: replace(case, model=case.model + effect)


def units() -> list[Fault]:
    """Readings in another unit than the model file expects."""
    g = 9.80665
    found = [
        Fault("unit", f"torque in {unit}", _scaled("torque", factor))
        for unit, factor in (("N mm", 1e3), ("N cm", 1e2), ("kN m", 1e-3), ("kgf m", 1.0 / g))
    ]
    found += [
        Fault("unit", f"load in {unit}", _scaled("load", factor))
        for unit, factor in (("kg", 1.0 / g), ("g", 1e3 / g), ("kN", 1e-3))
    ]
    found.append(Fault("unit", "slip in percent", _scaled("slip", 100.0)))
    return found + [
        Fault("unit", f"sinkage in {unit}", _scaled("sinkage", factor), sinkage_only=True)
        for unit, factor in (("mm", 1e3), ("cm", 1e2))
    ]


def wheels() -> list[Fault]:
    """Readings of a larger or smaller wheel than that of the model file."""
    factors = (0.5, 1.0 / 1.5, 0.8, 1.25, 1.5, 2.0)
    return [
        Fault("wheel", f"{key} x {factor:.2f}", case=_with_wheel(key, factor))
        for key in ("radius", "width")
        for factor in factors
    ]


def sensors() -> list[Fault]:
    """Scale and offset errors of the slip and torque sensors."""
    return [
        Fault("sensor", "slip read as 1.1 s", _scaled("slip", 1.1)),
        Fault("sensor", "slip read as s + 0.1", _shifted("slip", 0.1)),
        Fault("sensor", "torque + 0.1 N m", _shifted("torque", 0.1)),
        Fault("sensor", "torque + 0.2 N m", _shifted("torque", 0.2)),
    ]


def effects(case: Case) -> list[Fault]:
    """Every effect that applies to this gear, at twice its reference size or at its bound."""
    found = []
    for name, cls in EFFECTS.items():
        if not cls.applies_to(case.model.gear) or name == "torque-offset":
            continue
        size = dict(cls.about.reference)
        bound = declared(cls)[cls.about.size]
        twice = np.clip(2.0 * size[cls.about.size], bound.lower, bound.upper)
        size[cls.about.size] = float(twice)
        label = f"{name}, {cls.about.size} {twice:g}"
        found.append(Fault(f"effect ({cls.about.kind})", label, case=_with_effect(cls(**size))))
    return found


def definitions() -> list[Fault]:
    """Readings of another definition: of slip by travel, of torque by its unit or its side."""
    return [
        Fault("unit", "torque in lbf ft", _scaled("torque", 1.356)),
        Fault("sensor", "torque halved", _scaled("torque", 0.5)),
        Fault(
            "sensor",
            "slip read as s / (1 - s)",
            lambda r: r | {"slip": r["slip"] / (1.0 - r["slip"])},
        ),
    ]


def mixed_rows() -> list[Fault]:
    """Sets whose rows are not all readings of one soil."""
    return [
        Fault(
            "rows",
            "two soils, half of the rows each",
            partition=lambda rows: (slice(0, rows // 2), slice(rows // 2, rows)),
            mix_rows=_half_of_another_soil,
        ),
        Fault(
            "rows",
            "torque of one row doubled",
            partition=lambda rows: (slice(1, rows),),
            mix_rows=_first_torque_doubled,
        ),
    ]


def faults(case: Case) -> list[Fault]:
    """All faults of the study."""
    return units() + wheels() + sensors() + effects(case) + mixed_rows()


def simulate(case: Case, theta: Floats, slip: Floats, load: Floats) -> Readings:
    """True readings (sets, conditions) on soils (sets, 3), at slips and loads (conditions,)."""
    values = dict(zip(case.prior, theta.T[:, :, None], strict=True))
    operating = Operating(slip=slip, load=load, **EFFECT_CONDITIONS)  # type: ignore[arg-type]
    own = case.with_values(values)
    force = own.model(own.soil, operating)
    shape = np.shape(force.torque)
    return {
        "slip": np.broadcast_to(slip, shape),
        "load": np.broadcast_to(load, shape),
        "torque": np.asarray(force.torque),
        "sinkage": np.asarray(force.sinkage),
        "drawbar_pull": np.asarray(force.drawbar_pull),
    }
