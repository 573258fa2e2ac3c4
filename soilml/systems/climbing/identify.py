"""Cohesion, friction angle and shear modulus from climbs on several slopes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from soilml.errors import FitError, InputError
from soilml.identification.diagnostics import HARDLY, NOT, TRADE_OFF
from soilml.identification.fit_result import Fit
from soilml.numerics.prior import Prior
from soilml.quantities import QUANTITIES, SHEAR
from soilml.systems.climbing.balance_likelihood import Balances
from soilml.systems.climbing.balance_noise import Shear
from soilml.systems.climbing.climb import Climb, Uncertainty, conditions
from soilml.systems.climbing.rover import Rover
from soilml.systems.climbing.soil_sampling import Found, Search
from soilml.systems.climbing.wheel_loads import with_loads

Floats = NDArray[np.float64]

#: Where the shear parameters of sands lie, for a user who gives neither value nor range.
USUAL = {
    "cohesion": Prior(0.0, 2000.0),
    "friction_angle": Prior(0.35, 0.87),
    "shear_modulus": Prior(0.001, 0.05, log=True),
}


@dataclass(frozen=True)
class Ground:
    """What climbs tell of the ground, and how each of them fits.

    `as_read` are draws that go with the stresses as they were read: an error of the entry angles
    which all runs share is in the stresses and in k_x, and hardly changes the pull of both.
    """

    fit: Fit
    draws: Floats  # (n, 3): c (Pa), phi (rad), k_x (m); what is given is the same in all
    as_read: Floats  # (n, 3)
    rover: Rover  # with the loads of its wheels, given or found
    noise: Uncertainty
    names: tuple[str, ...]  # of the climbs
    off: Floats  # (climbs,) N, pull less weight down the slope, at the mean of the draws
    off_std: Floats  # (climbs,) N
    slopes: int  # that differ

    @property
    def shear(self) -> Shear:
        """Mean (c, phi, k_x) of the draws."""
        mean = self.draws.mean(axis=0)
        return float(mean[0]), float(mean[1]), float(mean[2])


def identify_ground(
    rover: Rover,
    climbs: Sequence[Climb],
    *,
    given: Mapping[str, float] | None = None,
    prior: Mapping[str, Prior] | None = None,
    noise: Uncertainty | None = None,
    seed: int = 0,
) -> Ground:
    r"""(c, phi, k_x) from the balance of forces on slopes, with what stays open of them.

    .. math::
        2 (F_{xf} + F_{xr}) = m g \sin\alpha, \qquad 2 (F_{zf} + F_{zr}) = m g \cos\alpha

    The second equation gives M of each run in closed form; the first is then one equation for
    each run, weighed by what noise does to it (`spread`). Parameters in `given` are held, others
    drawn within `prior` from the posterior, whose mean and covariance are the answer. One slope is
    one condition however often it was driven: p parameters need p slopes. One M for each wheel
    and run is found only where the rover knows its loads; with the two sums alone each run would
    bring as many unknowns as equations. References: Nagatani et al., section 6. Raises
    `FitError` for too few slopes and for climbs that no one soil explains together, `InputError`
    for a climb that no soil of the prior explains alone.
    """
    given, prior, noise = dict(given or {}), dict(prior or {}), noise or Uncertainty()
    if unknown := sorted((given.keys() | prior.keys()) - set(SHEAR)):
        raise InputError(f"no soil parameter {unknown[0]!r}; there are: {', '.join(SHEAR)}")
    ranges = {name: prior.get(name, USUAL[name]) for name in SHEAR if name not in given}
    slopes = len(conditions(climbs, noise.slope)) if climbs else 0
    _refuse_too_few(slopes, list(ranges))
    held = given.get("shear_modulus", 0.0)
    balances = Balances.over(rover, climbs, ranges.get("shear_modulus") or Prior(held, held))
    found = Search(balances, given, ranges, noise).found(np.random.default_rng(seed))
    shear = found.draws.mean(axis=0)
    return Ground(
        fit=_fit(found, ranges, len(climbs), slopes, assumed=[n for n in ranges if n not in prior]),
        draws=found.draws,
        as_read=found.as_read,
        rover=with_loads(rover, climbs, (float(shear[0]), float(shear[1]), float(shear[2]))),
        noise=noise,
        names=tuple(climb.name for climb in climbs),
        off=found.off,
        off_std=found.off_std,
        slopes=slopes,
    )


def _refuse_too_few(slopes: int, free: list[str]) -> None:
    needed = max(len(free), 1)
    if slopes < needed:
        count = {0: "no climb", 1: "one slope"}.get(slopes, f"{slopes} slopes")
        given = [name for name in SHEAR if name in free and name != "shear_modulus"]
        hint = f", or {' or '.join(given)} as a number in [soil]" if given else ""
        raise FitError(
            f"{count} for {needed} parameters ({', '.join(free)}): each slope brings one equation "
            f"beside that for M; needed are {needed} slopes that differ{hint}"
        )


def _fit(
    found: Found, ranges: Mapping[str, Prior], climbs: int, slopes: int, assumed: list[str]
) -> Fit:
    free = list(ranges)
    values = found.draws[:, [SHEAR.index(name) for name in free]]
    covariance = np.atleast_2d(np.cov(values, rowvar=False)) if free else np.zeros((0, 0))
    fit = Fit(
        method="climbing",
        names=tuple(free),
        units=tuple(QUANTITIES[name].unit for name in free),
        values=values.mean(axis=0),
        covariance=covariance,
        warnings=(),
        rows_used=climbs,
        left={n: float(np.std(found.u[:, i]) * np.sqrt(12.0)) for i, n in enumerate(free)},
        misfit=found.misfit,
        channels=("slope_rad",),
    )
    said = []
    for name, left in fit.left.items():
        if left > NOT:
            said.append(f"{name} is not identified: the climbs leave {left:.0%} of its range")
        elif left > HARDLY:
            said.append(f"{name} is hardly identified: the climbs leave {left:.0%} of its range")
    correlation = fit.correlation
    said += [
        f"{a} and {b} trade for one another (correlation {correlation[i, j]:+.2f}): believe the "
        "pull that follows from both, not each"
        for i, a in enumerate(free)
        for j, b in enumerate(free)
        if i < j and abs(correlation[i, j]) > TRADE_OFF
    ]
    if found.widened > 1.0:
        said.append(
            f"the climbs miss their balance by {found.widened:.1f} times what the noise allows; "
            "std is widened by as much"
        )
    if slopes == 1:
        said.append("one slope: whether the parameters are the same on others is not checked")
    said += [
        f"{name} has neither value nor range in [soil]: {ranges[name].lower:g} to "
        f"{ranges[name].upper:g} {QUANTITIES[name].unit} is assumed"
        for name in assumed
    ]
    return replace(fit, warnings=tuple(said))
