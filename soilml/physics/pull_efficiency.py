"""Pull efficiency and tractive efficiency of a gear on a soil, and the traffic class of ground."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Array, Real, namespace, to_numpy
from soilml.errors import InputError
from soilml.physics.equilibrium import equilibrium_forces
from soilml.physics.forces import apply_input_effects, stresses_at_sinkage
from soilml.physics.gears.emulated import EmulatedGear
from soilml.physics.gears.wheel_leg_foot import Midstance
from soilml.physics.model import Model
from soilml.physics.operating_point import Operating
from soilml.physics.soils import Soil

#: Pull efficiency at which the next class begins. References: Comin and Saaj 2017, section V-C.
THRESHOLDS = (0.35, 0.50, 0.65)
CLASSES = ("non-trafficable", "unsafe", "safe", "trafficable")


def pull_efficiency(model: Model, soil: Soil, at: Operating) -> Array:
    r"""Fraction of a driving wheel's thrust that is not used up by resistance; arrays broadcast.

    .. math::
        \eta = \frac{F_T - F_R}{F_T} = \frac{DP}{F_T}, \quad F_T = \int \tau \cos\theta \, dA

    Negative where the wheel cannot propel itself; NaN where the soil does not carry the load.
    What effects subtract from the drawbar pull counts as resistance.

    Raises `InputError` for slip that is not above 0: there is no thrust.

    References: Comin and Saaj 2017, eq. 32.
    """
    load_case, shape = model.load_case(soil, at)
    xp = namespace(load_case.at.slip)
    if not bool(xp.all(load_case.at.slip > 0)):
        raise InputError(
            f"slip is {float(xp.min(load_case.at.slip)):g}; pull efficiency needs slip above 0"
        )
    with np.errstate(all="ignore"):
        force = equilibrium_forces(load_case)
        _, stresses = stresses_at_sinkage(apply_input_effects(load_case), force.sinkage)
    thrust = xp.sum(stresses.shear * stresses.contact.horizontal_area, axis=0)
    return xp.reshape(force.drawbar_pull / thrust, shape)


def tractive_efficiency(radius: Real, slip: Real, torque: Real, drawbar_pull: Real) -> Array:
    r"""Power at the drawbar over the power of the drive; arrays broadcast.

    .. math:: \eta = \frac{DP \, v}{T \, \omega} = \frac{(1 - s) \, r \, DP}{T}

    radius (m) is that of which the slip is; torque (N m) and drawbar pull (N) are of one gear.
    Negative where the gear cannot propel itself; NaN where it does not drive: slip or torque not
    above 0.

    References: Wong 2008, Theory of Ground Vehicles, 4th ed., section 4.2; named by Xue et al.
    2016, section 1.
    """
    xp = namespace(torque)
    slip, torque = xp.asarray(slip), xp.asarray(torque)
    with np.errstate(all="ignore"):
        ratio = (1.0 - slip) * radius * drawbar_pull / torque
    return xp.where((slip > 0.0) & (torque > 0.0), ratio, xp.nan)


def has_thrust(model: Model) -> bool:
    """Whether a gear rolls on stresses of the soil, so that it has these efficiencies.

    A leg does not roll; an emulator of another program has no stresses.
    """
    return model.gear.name not in (Midstance.name, EmulatedGear.name)


def traffic_class(efficiency: Real) -> NDArray[np.str_]:
    """Traffic class of each pull efficiency, of `CLASSES`; NaN (no equilibrium) is the first."""
    value = np.nan_to_num(to_numpy(efficiency), nan=-np.inf)
    index = np.searchsorted(THRESHOLDS, value, side="right")
    return np.asarray(np.asarray(CLASSES)[index])
