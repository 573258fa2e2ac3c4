"""Stresses and forces on a gear at a prescribed sinkage."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from soilml.arrays import Array, namespace
from soilml.physics.contact import Contact, Force, Stress, integrate, stress, vertical_load
from soilml.physics.effects.base import apply_stage
from soilml.physics.load_case import LoadCase
from soilml.row_status import Status


def apply_input_effects(load_case: LoadCase) -> LoadCase:
    """The load case with true slip and load, free of sensor errors, and the soil at that slip."""
    effects = load_case.effects
    load_case = replace(load_case, at=apply_stage(effects, "on_operating", load_case.at, load_case))
    return replace(load_case, soil=apply_stage(effects, "on_soil", load_case.soil, load_case))


def forces_at_sinkage(load_case: LoadCase, sinkage: Array) -> Force:
    """Forces on a gear at this sinkage (m), whatever its load; `load` is the load carried."""
    xp = namespace(sinkage)
    soil = load_case.soil
    geometry, stresses = stresses_at_sinkage(load_case, sinkage)
    load, pull, torque = integrate(stresses)
    status = load_case.gear.geometry_status(geometry)
    bearing_modulus = soil.kc / stresses.contact.width + soil.kphi + 0.0 * load
    no_bearing = (status == 0) & ~(bearing_modulus > 0)
    force = Force(
        load=load,
        torque=torque,
        drawbar_pull=pull,
        sinkage=sinkage,
        entry_angle=geometry.entry,
        status=xp.where(no_bearing, status + int(Status.NO_BEARING), status),
    )
    return apply_stage(load_case.effects, "on_force", force, load_case)


def load_at_sinkage(load_case: LoadCase, sinkage: Array) -> Array:
    """Load (N) that the soil carries at this sinkage (m); see `forces_at_sinkage`."""
    if any(effect.overrides("on_force") for effect in load_case.effects):
        return forces_at_sinkage(load_case, sinkage).load
    return vertical_load(stresses_at_sinkage(load_case, sinkage)[1])


def stresses_at_sinkage(load_case: LoadCase, sinkage: Array) -> tuple[Any, Stress]:
    """Geometry of the contact at this sinkage (m), and the stresses along it."""
    geometry = _geometry(load_case, sinkage)
    contact = load_case.gear.contact(geometry, load_case.at, load_case.resolution)
    return geometry, _stresses(load_case, contact)


def stress_profile(load_case: LoadCase, sinkage: Array, points: int) -> tuple[Array, Stress]:
    """Angles and stresses (points, batch) from entry to exit of a gear at this sinkage (m)."""
    load_case = apply_input_effects(load_case)
    geometry = _geometry(load_case, sinkage)
    angle, contact = load_case.gear.profile_contact(geometry, load_case.at, points)
    return angle, _stresses(load_case, contact)


def _geometry(load_case: LoadCase, sinkage: Array) -> Any:
    geometry = load_case.gear.contact_geometry(sinkage, load_case.soil, load_case.at)
    return apply_stage(load_case.effects, "on_contact", geometry, load_case)


def _stresses(load_case: LoadCase, contact: Contact) -> Stress:
    stresses = stress(contact, load_case.soil, load_case.at)
    return apply_stage(load_case.effects, "on_stress", stresses, load_case)
