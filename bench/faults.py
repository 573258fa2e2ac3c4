"""Faults of readings: wrong units and wheels, sensor errors, unmodelled effects."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from soilml.config.case import Case
from soilml.parameters import declared
from soilml.physics.effects import EFFECTS
from soilml.physics.operating_point import Operating

Floats = np.ndarray[Any, np.dtype[np.float64]]
Order = np.ndarray[Any, np.dtype[np.int64]]
#: slip, load (N), torque (N m), sinkage (m), drawbar_pull (N): arrays of one shape.
Readings = dict[str, Floats]
Report = Callable[[Readings], Readings]
#: Operating conditions: six slips at six loads (N); sets have the first rows of a shuffle of them.
SLIP = np.repeat([0.08, 0.14, 0.21, 0.29, 0.38, 0.48], 6)
LOAD = np.tile([40.0, 52.0, 65.0, 79.0, 94.0, 110.0], 6)
COLUMNS = {"torque": "torque_Nm", "sinkage": "sinkage_m", "drawbar_pull": "drawbar_pull_N"}
#: Operating conditions that some effects need: speed (m/s), pass in a rut, slip angle (rad).
EFFECT_CONDITIONS = {"speed": 0.2, "pass_number": 2.0, "slip_angle": 0.2}


@dataclass(frozen=True)
class Fault:
    """A difference between the model of an estimator and reality, or the readings of it.

    `report` maps true readings to reported ones; `case` maps the nominal case to the true one.
    """

    name: str
    report: Report = field(default=lambda r: r)
    case: Callable[[Case], Case] = field(default=lambda case: case)


def _scaled(name: str, factor: float) -> Report:
    return lambda r: r | {name: factor * r[name]}


def _shifted(name: str, offset: float) -> Report:
    return lambda r: r | {name: r[name] + offset}


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
        Fault(f"torque in {unit}", _scaled("torque", factor))
        for unit, factor in (("N mm", 1e3), ("N cm", 1e2), ("kN m", 1e-3), ("kgf m", 1.0 / g))
    ]
    found += [
        Fault(f"load in {unit}", _scaled("load", factor))
        for unit, factor in (("kg", 1.0 / g), ("g", 1e3 / g), ("kN", 1e-3))
    ]
    found.append(Fault("slip in percent", _scaled("slip", 100.0)))
    return found + [
        Fault(f"sinkage in {unit}", _scaled("sinkage", factor))
        for unit, factor in (("mm", 1e3), ("cm", 1e2))
    ]


def wheels() -> list[Fault]:
    """Readings of a larger or smaller wheel than that of the model file."""
    factors = (0.5, 1.0 / 1.5, 0.8, 1.25, 1.5, 2.0)
    return [
        Fault(f"{key} x {factor:.2f}", case=_with_wheel(key, factor))
        for key in ("radius", "width")
        for factor in factors
    ]


def sensors() -> list[Fault]:
    """Scale and offset errors of the slip and torque sensors."""
    return [
        Fault("slip read as 1.1 s", _scaled("slip", 1.1)),
        Fault("slip read as s + 0.1", _shifted("slip", 0.1)),
        Fault("torque + 0.1 N m", _shifted("torque", 0.1)),
        Fault("torque + 0.2 N m", _shifted("torque", 0.2)),
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
        found.append(Fault(label, case=_with_effect(cls(**size))))
    return found


def definitions() -> list[Fault]:
    """Readings of another definition: of slip by travel, of torque by its unit or its side."""
    return [
        Fault("torque in lbf ft", _scaled("torque", 1.356)),
        Fault("torque halved", _scaled("torque", 0.5)),
        Fault(
            "slip read as s / (1 - s)",
            lambda r: r | {"slip": r["slip"] / (1.0 - r["slip"])},
        ),
    ]


def faults(case: Case) -> list[Fault]:
    """All faults of the study."""
    return units() + wheels() + sensors() + effects(case)


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


def add_noise(r: Readings, case: Case, seed: int) -> Readings:
    """Readings with the recipe's noise."""
    rng = np.random.default_rng(seed)
    std = {name: np.asarray(case.noise[key].std(r[name])) for name, key in COLUMNS.items()}
    return r | {k: r[k] + std[k] * rng.standard_normal(std[k].shape) for k in COLUMNS}


def shuffled_conditions(sets: int, seed: int) -> Order:
    """Order (sets, conditions) of rows: every slip once, then every slip at another load, ..."""
    rng = np.random.default_rng(seed)
    loads, slips = (rng.permuted(np.tile(np.arange(6), (sets, 6, 1)), axis=2) for _ in range(2))
    chosen = np.take_along_axis(loads.swapaxes(1, 2), slips, axis=2)  # (sets, round, position)
    return (6 * slips + chosen).reshape(sets, 36)


def select_rows(r: Readings, order: Order) -> Readings:
    """Rows (sets, rows) in this order."""
    return {k: np.take_along_axis(v, order, axis=1) for k, v in r.items()}
