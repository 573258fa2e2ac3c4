"""Forces and sensor readings at the sinkage at which the soil carries the load."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from soilml.arrays import namespace, no_gradient, requires_gradient
from soilml.parameters import values
from soilml.physics.contact import Force
from soilml.physics.effects.base import apply_stage
from soilml.physics.forces import apply_input_effects, forces_at_sinkage
from soilml.physics.gears.emulated import EmulatedGear
from soilml.physics.load_case import LoadCase
from soilml.physics.sinkage_estimate import SinkageEstimate
from soilml.physics.sinkage_search import equilibrium_near, first_equilibrium

#: Relative step in sinkage of the central difference for dW/dz. Its truncation error is of the
#: order of the step squared, and an error in the slope of a Newton step only scales its derivative.
RELATIVE_STEP = 1e-5


def sensor_readings(load_case: LoadCase, estimate: SinkageEstimate | None = None) -> Force:
    """Forces at equilibrium as the sensors report them; see `equilibrium_forces`."""
    force = equilibrium_forces(load_case, estimate)
    true_case = apply_input_effects(load_case)
    return without_unsolved(apply_stage(load_case.effects, "on_reading", force, true_case))


def equilibrium_forces(load_case: LoadCase, estimate: SinkageEstimate | None = None) -> Force:
    """Forces at the smallest sinkage at which the soil carries the load; arrays (batch,).

    From an estimate of the sinkage the search is shorter; see `equilibrium_near`.
    """
    load_case = apply_input_effects(load_case)
    if isinstance(load_case.gear, EmulatedGear):
        force = load_case.gear.forces(load_case.soil, load_case.at)
        return apply_stage(load_case.effects, "on_force", force, load_case)
    plain = isinstance(load_case.at.load, np.ndarray)  # then no parameter has a gradient
    parameters = [] if plain else list(values(load_case).values())
    with no_gradient(parameters):
        force = (
            first_equilibrium(load_case)
            if estimate is None
            else equilibrium_near(load_case, estimate)
        )
    if requires_gradient(parameters):
        force = _with_gradients(load_case, force)
    return without_unsolved(force)


def _with_gradients(load_case: LoadCase, force: Force) -> Force:
    r"""The same forces, with their gradients through the equilibrium.

    .. math:: z(p) = z^* - \frac{W(z^*; p) - W}{\partial W / \partial z}

    One Newton step from the equilibrium sinkage: its value is zero, and its derivative is that of
    the implicit function theorem. Rows without equilibrium have no gradient.
    """
    xp = namespace(force.sinkage)
    with no_gradient(values(load_case).values()):
        z, h = force.sinkage, RELATIVE_STEP
        above = forces_at_sinkage(load_case, z * (1.0 + h)).load
        below = forces_at_sinkage(load_case, z * (1.0 - h)).load
        load_by_sinkage = (above - below) / (2.0 * h * z)
    excess = forces_at_sinkage(load_case, z).load - load_case.at.load
    solved = force.status == 0
    step = xp.where(solved, excess / load_by_sinkage, xp.zeros_like(z))
    return replace(forces_at_sinkage(load_case, z - step), status=force.status)


def without_unsolved(force: Force) -> Force:
    """The forces with NaN in every row that has no equilibrium."""
    xp = namespace(force.load)
    solved = force.status == 0
    nan = xp.full_like(force.load, math.nan)
    return replace(
        force,
        torque=xp.where(solved, force.torque, nan),
        drawbar_pull=xp.where(solved, force.drawbar_pull, nan),
        sinkage=xp.where(solved, force.sinkage, nan),
        entry_angle=xp.where(solved, force.entry_angle, nan),
    )
