"""Drives of a wheel whose sensors or soil are not as its model file assumes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from drawn_errors import DrawnErrors

from datagen.blind_sets.plans import MECHANISMS
from datagen.blind_sets.reference_wheel import (
    ContactPoints,
    Mechanism,
    WheelState,
    solve_equilibrium,
)
from datagen.recipe import read_recipe
from soilml import Operating
from soilml.physics.effects import FlatRim
from soilml.quantities import SHEAR, column

Floats = np.ndarray[Any, np.dtype[np.float64]]

#: Loads (N) of the drives; slips fill the range of the recipe.
LOADS = (40.0, 70.0, 100.0)
#: Least true slip.
LEAST_SLIP = 0.003


@dataclass(frozen=True)
class World:
    """What differs from the model file's assumptions; errors are those of the reported values.

    `mechanism` names a mechanism of the blind sets, with its size.
    """

    name: str
    mechanism: tuple[str, float] | None = None
    rim: float = 0.0  # compliance (m/N) of a rim that lies flat, by the package's own model
    radius: float = 1.0  # true radius over that assumed
    bearing: float = 1.0  # true bearing pressure over that assumed
    slip_offset: float = 0.0
    load_gain: float = 0.0
    torque_gain: float = 0.0
    usual: float = 0.0  # size of errors of all kinds, drawn for each soil, over the usual one


@dataclass(frozen=True)
class SimulatedDrives:
    """Readings (sets, rows) by name, and the soils (sets, 3)."""

    readings: dict[str, Floats]
    truth: Floats


#: Worlds, of which the first is sound.
WORLDS = (
    World("nothing"),
    World("slip + 0.03", slip_offset=0.03),
    World("slip - 0.03", slip_offset=-0.03),
    World("torque gain 5 %", torque_gain=0.05),
    World("load gain 2 %", load_gain=0.02),
    World("slip-sinkage, n1 0.3", mechanism=("slip-sinkage", 0.3)),
    World("exit angle, kappa 0.25", mechanism=("exit-angle", 0.25)),
    World("lugs of 10 mm", mechanism=("grousers", 0.01)),
    World("bearing pressure x 2", bearing=2.0),
    World("all typical errors at once", usual=1.0),
)
#: Worlds in which a law is another one, at the reference sizes of the blind sets; a rim that lies
#: flat gives way by 2 % of the radius.
LAW_WORLDS = (
    World("flat rim", rim=4e-5),
    World("shear curve with a peak", mechanism=("shear-softening/peak-and-decay", 0.3)),
    World("shear stress that falls to half", mechanism=("shear-softening", 1.4)),
    World("shear stress that falls beyond two moduli", mechanism=("falls-beyond-two-moduli", 0.5)),
    World("curved strength envelope", mechanism=("curved-envelope/logarithmic", 0.08)),
    World("stress-shift", mechanism=("stress-shift", 0.2)),
    World("sidewall-shear", mechanism=("sidewall-shear", 1.0)),
)
#: Mechanisms that no error of sensors or model describes, at their reference sizes.
UNLISTED = (
    "stress-shift",
    "stress-shift/with-slip",
    "sidewall-shear",
    "shear-softening",
    "bulldozing",
    "slip-sinkage/lyasko",
    "slip-sinkage/square",
    "exit-angle/constant",
    "grousers/saturating",
    "cable-drag",
    "stiff-layer",
    "crust",
    "ripple",
    "vibration",
    "stick-slip",
)


def mechanisms() -> dict[str, Mechanism]:
    """Mechanisms of all tiers by their keys, and a shear stress that falls."""
    known = {key: mechanism for tier in MECHANISMS.values() for key, mechanism in tier.items()}
    falls = replace(known["shear-softening"], acts={"shear": _falls_beyond_two_moduli})
    return known | {"falls-beyond-two-moduli": falls}


def _falls_beyond_two_moduli(points: ContactPoints, rows: WheelState, share: float) -> Floats:
    """Janosi and Hanamoto's stress up to j = 2 K, which then falls by `share`, over 2 K to 1/e.

    Its modulus is that of the first slope; that of Wong's hump is about twice as large.
    """
    beyond = np.maximum(np.abs(points.shear_displacement) / rows.shear_modulus - 2.0, 0.0)
    return np.asarray(points.shear * (1.0 - share * -np.expm1(-0.5 * beyond)))


def unlisted_worlds() -> tuple[World, ...]:
    """A wheel of another radius, and each mechanism that no error describes."""
    known = mechanisms()
    return (
        *(World(f"radius x {r:g}", radius=r) for r in (0.95, 1.05)),
        *(World(key, mechanism=(key, known[key].reference)) for key in UNLISTED),
    )


def simulate(world: World, sets: int, rows: int, seed: int) -> SimulatedDrives:
    """Drives on soils of the recipe's prior, with its noise; the same soils for every world."""
    recipe = read_recipe("wheel")
    case, rng = recipe.case, np.random.default_rng(seed)
    truth = np.stack([case.prior[name].at(rng.random(sets)) for name in SHEAR], axis=1)
    slip = recipe.slip.at(rng.random((sets, rows)))
    load = rng.choice(LOADS, (sets, rows))
    errors = DrawnErrors.drawn(sets, seed, world.usual)
    gear: Any = case.model.gear
    fixed = {name: getattr(case.soil, name) for name in ("n", "a0", "a1", "unit_weight")}
    fixed |= {"radius": world.radius * gear.radius, "width": gear.width}
    fixed |= {"speed": 0.05, "pass_number": 1.0, "slip_angle": 0.0}
    of_soil = {name: truth[:, i, None] for i, name in enumerate(SHEAR)}
    driven = {
        "slip": np.maximum(slip - world.slip_offset - errors.slip_offset, LEAST_SLIP),
        "load": load / (1.0 + world.load_gain + errors.load_gain),
    }
    bearing = world.bearing * errors.factor_of_bearing(driven["slip"], driven["load"])
    of_soil |= {name: bearing * getattr(case.soil, name) for name in ("kc", "kphi")}
    state = WheelState(
        **{
            name: np.broadcast_to(np.asarray(value, float), slip.shape).reshape(-1)
            for name, value in (fixed | of_soil | driven).items()
        }
    )
    name, size = world.mechanism or ("", 0.0)
    active = [(mechanisms()[name], size)] if name else []
    if world.usual:
        active.append((errors.mechanism(slip), 1.0))
    found = solve_equilibrium(state, tuple(active))
    forces = {
        "torque": (1.0 + world.torque_gain) * found.torque.reshape(slip.shape),
        "sinkage": found.sinkage.reshape(slip.shape),
        "drawbar_pull": found.pull.reshape(slip.shape),
    }
    if world.rim:
        forces = _of_flat_rim(world.rim, truth, slip, load)
    true = errors.of_readings(forces, load)
    readings = {
        key: value + case.noise[column(key)].std(value) * rng.standard_normal(slip.shape)
        for key, value in true.items()
    }
    return SimulatedDrives(readings | {"slip": slip, "load": load}, truth)


def _of_flat_rim(compliance: float, truth: Floats, slip: Floats, load: Floats) -> dict[str, Floats]:
    """Forces (sets, rows) of a rim that lies flat along a chord, which the blind sets lack."""
    case = read_recipe("wheel").case
    model = case.model + FlatRim(compliance=compliance)
    forces = []
    for own, at_slip, at_load in zip(truth, slip, load, strict=True):
        soil = case.with_values(dict(zip(SHEAR, map(float, own), strict=True))).soil
        forces.append(model(soil, Operating(slip=at_slip, load=at_load)))
    names = ("torque", "sinkage", "drawbar_pull")
    return {name: np.stack([getattr(force, name) for force in forces]) for name in names}
