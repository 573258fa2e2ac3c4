"""Pull, torque and sinkage of all wheels of a rover against their common slip."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.fitting.operating_points import wheel_gears, wheel_passes
from soilml.physics.model import Model
from soilml.physics.operating_point import Operating
from soilml.traction.pull_and_slope import EXCLUDED_KINDS
from soilml.traction.soil_draws import SoilDraws

Floats = NDArray[np.float64]

#: Loads (N) that agree to this share are those of one wheel, solved once.
SAME_LOAD = 1e-9


@dataclass(frozen=True)
class WheelCurves:
    """Of k wheels, for n draws of the soil and m slips, (k, n, m); NaN where not carried."""

    pull: Floats  # N
    torque: Floats  # N m
    sinkage: Floats  # m
    radius: Floats  # (k,), m

    @property
    def total_pull(self) -> Floats:
        """Pull of all wheels, N (n, m)."""
        return np.asarray(self.pull.sum(axis=0))

    def energy(self, slip: Floats) -> Floats:
        r"""Mechanical work of all wheels for each metre of travel, J/m (n, m).

        .. math:: E = \sum_i \frac{T_i}{r_i (1 - s)}
        """
        work = (self.torque / self.radius[:, None, None]).sum(axis=0)
        return np.asarray(work / (1.0 - slip))


def wheel_curves(
    case: Case, draws: SoilDraws, slope: Floats, slip: Floats, speed: float | None = None
) -> WheelCurves:
    """Curves of a case's rover straight up a slope.

    Parameters
    ----------
    case
        With a rover. Effects of rig and sensors are left out.
    draws
        Draws (n, p) of the soil.
    slope
        In rad, a number or one for each draw (n,).
    slip
        Slips (m,).
    speed
        Travel speed, m/s, where an effect needs it.

    Raises
    ------
    InputError
        Where a wheel leaves the ground, or an effect needs what a rover does not tell.
    """
    rover = case.rover
    assert rover is not None
    count = len(draws.values)
    loads = rover.loads(np.broadcast_to(slope, count))
    gears, passes = wheel_gears(case), wheel_passes(case)
    solved: list[tuple[str, int, Floats, tuple[Floats, ...]]] = []
    curves, radius = [], []
    for name, load in zip(rover.wheels, loads, strict=True):
        own_case = case.of_gear(gears[name]) if gears[name] else case
        radius.append(float(own_case.model.gear.radius))
        same = [
            found
            for gear, number, other, found in solved
            if gear == gears[name]
            and number == passes[name]
            and np.allclose(load, other, rtol=SAME_LOAD, atol=0.0)
        ]
        if not same:
            found = _forces(own_case, draws, load, slip, passes[name], speed)
            solved.append((gears[name], passes[name], load, found))
            same = [found]
        curves.append(same[0])
    pull, torque, sinkage = (np.stack(each) for each in zip(*curves, strict=True))
    return WheelCurves(pull, torque, sinkage, np.asarray(radius))


def _forces(
    case: Case, draws: SoilDraws, load: Floats, slip: Floats, number: int, speed: float | None
) -> tuple[Floats, ...]:
    own = tuple(e for e in case.model.effects if e.about.kind not in EXCLUDED_KINDS)
    case = replace(case, model=Model(case.model.gear, own))
    draw, column = (grid.ravel() for grid in np.indices((len(load), len(slip))))
    soils = draws.of(case, draw)
    at = Operating(
        slip=slip[column], load=load[draw], pass_number=float(number), speed=speed, slip_angle=0.0
    )
    force = soils.model(soils.soil, at)
    shape = (len(load), len(slip))
    return tuple(
        np.reshape(np.asarray(part), shape)
        for part in (force.drawbar_pull, force.torque, force.sinkage)
    )
