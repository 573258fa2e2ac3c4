"""Readings that a model was not made for: wrong units and wheels, faults, unknown effects."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from soilml.config.case import Case
from soilml.parameters import declared
from soilml.physics.effects import EFFECTS
from soilml.physics.effects.base import suits
from soilml.physics.operating_point import Operating

Floats = np.ndarray[Any, np.dtype[np.float64]]
#: slip, load, torque, sinkage, drawbar_pull, arrays of one shape.
Readings = dict[str, Floats]
Told = Callable[[Readings], Readings]
#: Driving that some effects need: speed in m/s, pass in a rut, slip angle in rad.
DRIVEN = {"speed": 0.2, "pass_number": 2.0, "slip_angle": 0.2}
#: Number of rows -> those that one soil explains together.
Parts = Callable[[int], Sequence[slice]]


@dataclass(frozen=True)
class Kind:
    """What differs from what the model takes for given: reality, or what is told of it.

    `parts` are the rows that one soil explains each, where the fault is known; `rows` mixes the
    rows of a set with those of another, both (sets, rows); `sunk` says that only sinkage is wrong.
    """

    group: str
    name: str
    told: Told = field(default=lambda r: r)
    case: Callable[[Case], Case] = field(default=lambda case: case)
    parts: Parts = field(default=lambda rows: (slice(0, rows),))
    rows: Callable[[Readings, Readings], Readings] = field(default=lambda own, other: own)
    sunk: bool = False


def _times(name: str, factor: float) -> Told:
    return lambda r: r | {name: factor * r[name]}


def _plus(name: str, offset: float) -> Told:
    return lambda r: r | {name: r[name] + offset}


def _glitch(own: Readings, other: Readings) -> Readings:
    first = np.arange(own["torque"].shape[-1]) == 0
    return own | {"torque": np.where(first, 2.0, 1.0) * own["torque"]}


def _halves(own: Readings, other: Readings) -> Readings:
    count = own["torque"].shape[-1]
    return {k: np.where(np.arange(count) < count // 2, v, other[k]) for k, v in own.items()}


def _wheel(key: str, factor: float) -> Callable[[Case], Case]:
    def real(case: Case) -> Case:
        gear: Any = case.model.gear
        return case.with_values({f"gear.{key}": factor * getattr(gear, key)})

    return real


def _with(effect: Any) -> Callable[[Case], Case]:
    return lambda case: replace(case, model=case.model + effect)


def units() -> list[Kind]:
    """Numbers in another unit than the model reads."""
    g = 9.80665
    found = [
        Kind("unit", f"torque in {unit}", _times("torque", factor))
        for unit, factor in (("N mm", 1e3), ("N cm", 1e2), ("kN m", 1e-3), ("kgf m", 1.0 / g))
    ]
    found += [
        Kind("unit", f"load in {unit}", _times("load", factor))
        for unit, factor in (("kg", 1.0 / g), ("g", 1e3 / g), ("kN", 1e-3))
    ]
    found.append(Kind("unit", "slip in percent", _times("slip", 100.0)))
    return found + [
        Kind("unit", f"sinkage in {unit}", _times("sinkage", factor), sunk=True)
        for unit, factor in (("mm", 1e3), ("cm", 1e2))
    ]


def wheels() -> list[Kind]:
    """Rows of a larger or smaller wheel than the one that the model is for."""
    factors = (0.5, 1.0 / 1.5, 0.8, 1.25, 1.5, 2.0)
    return [
        Kind("wheel", f"{key} x {factor:.2f}", case=_wheel(key, factor))
        for key in ("radius", "width")
        for factor in factors
    ]


def sensors() -> list[Kind]:
    """Faults of slip and torque."""
    return [
        Kind("sensor", "slip read as 1.1 s", _times("slip", 1.1)),
        Kind("sensor", "slip read as s + 0.1", _plus("slip", 0.1)),
        Kind("sensor", "torque + 0.1 N m", _plus("torque", 0.1)),
        Kind("sensor", "torque + 0.2 N m", _plus("torque", 0.2)),
    ]


def effects(case: Case) -> list[Kind]:
    """Every effect that suits this gear at twice its reference size, or at its bound."""
    found = []
    for name, cls in EFFECTS.items():
        if not suits(cls, case.model.gear) or name == "torque-offset":
            continue
        size = dict(cls.about.reference)
        bound = declared(cls)[cls.about.size]
        twice = np.clip(2.0 * size[cls.about.size], bound.lower, bound.upper)
        size[cls.about.size] = float(twice)
        label = f"{name}, {cls.about.size} {twice:g}"
        found.append(Kind(f"effect ({cls.about.kind})", label, case=_with(cls(**size))))
    return found


def mixed() -> list[Kind]:
    """Rows that do not belong together."""
    return [
        Kind(
            "rows",
            "two soils, half of the rows each",
            parts=lambda rows: (slice(0, rows // 2), slice(rows // 2, rows)),
            rows=_halves,
        ),
        Kind(
            "rows", "torque of one row doubled", parts=lambda rows: (slice(1, rows),), rows=_glitch
        ),
    ]


def kinds(case: Case) -> list[Kind]:
    """All of them."""
    return units() + wheels() + sensors() + effects(case) + mixed()


def driven(case: Case, theta: Floats, slip: Floats, load: Floats) -> Readings:
    """True readings (sets, ways) on soils (sets, 3) of the prior's names, driven (ways,)."""
    values = dict(zip(case.prior, theta.T[:, :, None], strict=True))
    at = Operating(slip=slip, load=load, **DRIVEN)  # type: ignore[arg-type]
    own = case.with_values(values)
    force = own.model(own.soil, at)
    shape = np.shape(force.torque)
    return {
        "slip": np.broadcast_to(slip, shape),
        "load": np.broadcast_to(load, shape),
        "torque": np.asarray(force.torque),
        "sinkage": np.asarray(force.sinkage),
        "drawbar_pull": np.asarray(force.drawbar_pull),
    }
