"""Drawbar pull and climbable slope against slip, for every soil that may be there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.numerics.root_finding import rising_root
from soilml.physics.model import Model
from soilml.physics.operating_point import Operating
from soilml.traction.soil_draws import SoilDraws

Floats = NDArray[np.float64]

#: Steepest slope that is searched, rad (86 degrees); a wheel that sticks to more is held there.
STEEPEST = 1.5
#: Kinds of effects that belong to the rig and the sensors that the rows came from.
LEFT_BEHIND = ("rig", "sensor")


@dataclass(frozen=True)
class Traction:
    """What a running gear under one load does on each of many soils; NaN where it sinks in.

    `slope` is what a vehicle climbs steadily at that slip, below zero where it only goes downhill.
    """

    load: float  # N
    slip: Floats  # (m,)
    pull: Floats  # (n, m), N, on the flat
    slope: Floats  # (n, m), rad

    @property
    def largest_pull(self) -> Floats:
        """The largest drawbar pull of each draw, N (n,)."""
        return _largest(self.pull)

    @property
    def best_slip(self) -> Floats:
        """The slip of it, (n,)."""
        return self._slip_of(self.pull)

    @property
    def steepest(self) -> Floats:
        """The steepest slope of each draw, rad (n,)."""
        return _largest(self.slope)

    @property
    def steepest_slip(self) -> Floats:
        """The slip of it, (n,)."""
        return self._slip_of(self.slope)

    @property
    def sunk(self) -> float:
        """Share of draws and slips without an answer."""
        return float(np.mean(~np.isfinite(self.pull)))

    @property
    def rising(self) -> float:
        """Share of draws whose pull still rises at the highest slip: they might do more."""
        return float(np.mean(self.best_slip == self.slip[-1]))

    def _slip_of(self, values: Floats) -> Floats:
        found = self.slip[np.argmax(np.nan_to_num(values, nan=-np.inf), axis=1)]
        return np.where(np.isfinite(values).any(axis=1), found, np.nan)


def traction(
    case: Case,
    draws: SoilDraws,
    load: float,
    slip: Floats,
    given: Mapping[str, float] | None = None,
) -> Traction:
    r"""Pull (n, m) and slope (n, m) of n draws of the soil at m slips (m,) under a load (N).

    The slope :math:`\alpha` is the one on which a wheel that carries its share across the slope
    pulls its share along it,

    .. math:: W \sin\alpha = DP(s, W \cos\alpha)

    with all wheels alike. `given` are speed, pass number and slip angle, where an effect needs
    them. Effects of rig and sensors stay behind: what a cell reads is not what the wheel pulls.
    References: Wong, Theory of Ground Vehicles, chapter 3. Does not hold for load transfer to the
    wheels behind, across the slope, in turns, nor where the slope itself is about to slide.
    """
    own = [e for e in case.model.effects if e.about.kind not in LEFT_BEHIND]
    case = replace(case, model=Model(case.model.gear, tuple(own)))
    known = dict(given or {})
    count = len(draws.values)
    rows, columns = (grid.ravel() for grid in np.indices((count, len(slip))))

    def pulled(place: NDArray[np.int64], load: Floats) -> Floats:
        changed = draws.of(case, rows[place])
        at = Operating(slip=slip[columns[place]], load=load, **known)
        return np.asarray(changed.model(changed.soil, at).drawbar_pull)

    flat = pulled(np.arange(rows.size), np.full(rows.size, load))
    carried = np.flatnonzero(np.isfinite(flat))

    def too_steep(angle: Floats) -> Floats:
        across = load * np.cos(angle)
        return np.asarray(angle - np.arctan(pulled(carried, across) / across))

    ends = np.full(carried.size, STEEPEST)
    guess = np.arctan(flat[carried] / load)
    root = rising_root(too_steep, -ends, ends, guess, np.ones(carried.size))
    slope = np.full(rows.size, np.nan)
    slope[carried] = np.where(root.converged | (root.x >= STEEPEST), root.x, np.nan)
    shape = (count, len(slip))
    return Traction(float(load), slip, flat.reshape(shape), slope.reshape(shape))


def _largest(values: Floats) -> Floats:
    found = np.nan_to_num(values, nan=-np.inf).max(axis=1)
    return np.where(np.isfinite(found), found, np.nan)
