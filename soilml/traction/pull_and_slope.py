"""Drawbar pull and climbable slope against slip, for draws of the soil and of the model's error."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.fitting.mixtures import EXCLUDED_KINDS, without_faults
from soilml.numerics.quantiles import quantile_band
from soilml.numerics.root_finding import rising_root
from soilml.physics.contact import Force
from soilml.physics.operating_point import Operating
from soilml.physics.pull_efficiency import has_thrust, pull_efficiency, tractive_efficiency
from soilml.remarks import Remark
from soilml.traction.draws import SoilDraws

#: Upper end of the slopes searched, rad (86 degrees); steeper ones are clipped to it.
LARGEST_SLOPE = 1.5


@dataclass(frozen=True)
class Traction:
    """Pull and slope of a running gear under one load, for n draws of the soil and m slips.

    Attributes
    ----------
    load
        Vertical load, N.
    slip
        Slips (m,).
    pull
        Drawbar pull on level ground, N (n, m); NaN where the soil does not carry the load.
    slope
        Slope that a vehicle climbs steadily, rad (n, m); negative where it only descends.
    sinkage
        Sinkage on level ground, m (n, m).
    tractive_efficiency
        Power at the drawbar over that of the drive on level ground, (n, m); NaN for a leg.
    pull_efficiency
        Share of the thrust that is left as pull, (n, m); NaN for a leg and for an emulator.
    """

    load: float
    slip: Floats
    pull: Floats
    slope: Floats
    sinkage: Floats
    tractive_efficiency: Floats
    pull_efficiency: Floats

    @property
    def largest_pull(self) -> Floats:
        """The largest drawbar pull of each draw, N (n,)."""
        return _largest(self.pull)

    @property
    def best_slip(self) -> Floats:
        """The slip at the largest drawbar pull, (n,)."""
        return self._slip_of(self.pull)

    @property
    def steepest_slope(self) -> Floats:
        """The steepest slope of each draw, rad (n,)."""
        return _largest(self.slope)

    @property
    def steepest_slip(self) -> Floats:
        """The slip at the steepest slope, (n,)."""
        return self._slip_of(self.slope)

    @property
    def most_efficient(self) -> int | None:
        """Index of the slip of the largest median tractive efficiency; None without one."""
        usual = quantile_band(self.tractive_efficiency).middle
        return int(np.nanargmax(usual)) if np.isfinite(usual).any() else None

    @property
    def failed_fraction(self) -> float:
        """Fraction of draws and slips without equilibrium."""
        return float(np.mean(~np.isfinite(self.pull)))

    @property
    def rising_fraction(self) -> float:
        """Fraction of draws whose pull still increases at the highest slip."""
        return float(np.mean(self.best_slip == self.slip[-1]))

    def _slip_of(self, values: Floats) -> Floats:
        slip = self.slip[np.argmax(np.nan_to_num(values, nan=-np.inf), axis=1)]
        return np.where(np.isfinite(values).any(axis=1), slip, np.nan)


def excluded_effects(case: Case) -> list[Remark]:
    """A remark on the effects that `without_faults` leaves out, if there are any."""
    names = [e.name for e in case.model.effects if e.about.kind in EXCLUDED_KINDS]
    text = f"effects of rig and sensors are excluded: {', '.join(names)}"
    return [Remark("effects-excluded", text, tuple(names), "note")] if names else []


def predict_traction(
    case: Case,
    draws: SoilDraws,
    load: float,
    slip: Floats,
    covariates: Mapping[str, float] | None = None,
) -> Traction:
    r"""Pull and slope for n draws of the soil at m slips under a load.

    The slope :math:`\alpha` is the one on which the drawbar pull under the normal component of the
    load equals the component along the slope,

    .. math:: W \sin\alpha = DP(s, W \cos\alpha)

    with all wheels equal. Effects of the rig and the sensors are removed from the model. Does not
    hold with load transfer between axles, across the slope, in turns, nor where the slope itself is
    close to sliding.

    Parameters
    ----------
    case
        Model and soil.
    draws
        Draws (n, p) of soil parameters, with errors of the model where it has some.
    load
        Vertical load on level ground, N.
    slip
        Slips (m,).
    covariates
        Speed, pass number and slip angle, where an effect needs them.

    References
    ----------
    Wong, Theory of Ground Vehicles, chapter 3; the efficiencies as in
    `soilml.physics.pull_efficiency`, without the error of the model's torque.
    """
    case = without_faults(case)
    count = len(draws.values)
    rows, columns = (grid.ravel() for grid in np.indices((count, len(slip))))

    def forces(index: NDArray[np.int64], normal_load: Floats) -> tuple[Operating, Force]:
        at = Operating(slip=slip[columns[index]], load=normal_load, **dict(covariates or {}))
        return at, draws.forces(case, rows[index], at)

    at, force = forces(np.arange(rows.size), np.full(rows.size, load))
    level = np.asarray(force.drawbar_pull)
    tractive, efficiency = np.full((2, rows.size), np.nan)
    if has_thrust(case.model):
        soils = draws.of(case, rows)
        radius = np.asarray(soils.model.gear.radius)
        tractive = np.asarray(tractive_efficiency(radius, at.slip, force.torque, level))
        efficiency = np.asarray(pull_efficiency(soils.model, soils.soil, at))
    carried = np.flatnonzero(np.isfinite(level))

    def excess_angle(angle: Floats) -> Floats:
        """Slope less the one that the pull on it balances."""
        normal_load = load * np.cos(angle)
        pull = forces(carried, normal_load)[1].drawbar_pull
        return np.asarray(angle - np.arctan(pull / normal_load))

    bound = np.full(carried.size, LARGEST_SLOPE)
    guess = np.arctan(level[carried] / load)
    root = rising_root(excess_angle, -bound, bound, guess, np.ones(carried.size))
    slope = np.full(rows.size, np.nan)
    slope[carried] = np.where(root.converged | (root.x >= LARGEST_SLOPE), root.x, np.nan)
    shape = (count, len(slip))
    found = (
        np.reshape(values, shape) for values in (level, slope, force.sinkage, tractive, efficiency)
    )
    return Traction(float(load), slip, *found)


def _largest(values: Floats) -> Floats:
    largest = np.nan_to_num(values, nan=-np.inf).max(axis=1)
    return np.where(np.isfinite(largest), largest, np.nan)
