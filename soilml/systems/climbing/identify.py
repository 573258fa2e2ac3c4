"""Cohesion, friction angle and shear modulus from climbs of several slopes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from soilml.arrays import Floats
from soilml.errors import FitError, InputError
from soilml.identification.fit import STRONG_CORRELATION, Fit
from soilml.numerics.prior import Prior
from soilml.quantities import NOT_IDENTIFIED_ABOVE, QUANTITIES, SHEAR, WEAKLY_IDENTIFIED_ABOVE
from soilml.remarks import Remark
from soilml.report.numbers import share_left
from soilml.systems.climbing.climb import Climb, Rover, ShearParameters, Uncertainty, group_by_slope
from soilml.systems.climbing.climb_balances import ForceBalances
from soilml.systems.climbing.soil_sampling import SoilPosterior, SoilSampler
from soilml.systems.climbing.wheel_force_components import estimate_wheel_loads

#: Priors of the shear parameters of sands, used where neither a value nor a range is given.
DEFAULT_PRIORS = {
    "cohesion": Prior(0.0, 2000.0),
    "friction_angle": Prior(0.35, 0.87),
    "shear_modulus": Prior(0.001, 0.05, log=True),
}


@dataclass(frozen=True)
class GroundEstimate:
    """Soil parameters estimated from climbs, and the residual of each climb.

    `samples_as_measured` are consistent with the stresses as measured: an error of the entry angles
    common to all runs affects stresses and k_x, and the two effects nearly cancel in the pull.
    """

    fit: Fit
    samples: Floats  # (n, 3): c (Pa), phi (rad), k_x (m); fixed parameters are constant
    samples_as_measured: Floats  # (n, 3)
    rover: Rover  # with the loads of its wheels, known or estimated
    noise: Uncertainty
    climb_names: tuple[str, ...]
    residual: Floats  # (climbs,) N, pull less the weight along the slope, at the posterior mean
    residual_std: Floats  # (climbs,) N
    distinct_slopes: int

    @property
    def shear(self) -> ShearParameters:
        """Posterior mean of (c, phi, k_x)."""
        mean = self.samples.mean(axis=0)
        return float(mean[0]), float(mean[1]), float(mean[2])


def identify_ground(
    rover: Rover,
    climbs: Sequence[Climb],
    *,
    fixed: Mapping[str, float] | None = None,
    prior: Mapping[str, Prior] | None = None,
    noise: Uncertainty | None = None,
    seed: int = 0,
) -> GroundEstimate:
    r"""Estimate (c, phi, k_x) and their posterior from the force balance on slopes.

    .. math::
        2 (F_{xf} + F_{xr}) = m g \sin\alpha, \qquad 2 (F_{zf} + F_{zr}) = m g \cos\alpha

    The second equation gives M of each run in closed form; the first is then one equation for each
    run, weighted by the noise of its balance (`balance_std`). The posterior mean and covariance are
    the estimate. Repeated climbs of one slope are one condition: p parameters need p slopes. Each
    wheel has its own M only if the loads of the wheels are known; with the two sums alone each run
    would add as many unknowns as equations.

    Parameters
    ----------
    rover
        Mass, wheels and, where known, the centre of mass.
    climbs
        Steady climbs with slip and stress of both wheels.
    fixed
        Known values of `cohesion` (Pa), `friction_angle` (rad) or `shear_modulus` (m).
    prior
        Ranges of the others; `DEFAULT_PRIORS` where missing.
    noise
        Standard deviations of the measurements.
    seed
        Seed of the posterior samples.

    Raises
    ------
    FitError
        For too few slopes, and for climbs that no single soil explains.
    InputError
        For an unknown parameter, and for a climb that no soil of the prior explains.

    References
    ----------
    Nagatani et al., section 6.

    Examples
    --------
    >>> from soilml.systems.climbing import SimulatedRover
    >>> true = SimulatedRover()  # its shear modulus is 7.2 mm
    >>> rng = np.random.default_rng(0)
    >>> climbs = true.simulate_climbs(rng, np.deg2rad([0.0, 4.0]).tolist())
    >>> ground = identify_ground(
    ...     true.rover, climbs, fixed={"cohesion": 0.0, "friction_angle": 0.6632}
    ... )
    >>> modulus = ground.fit["shear_modulus"]
    >>> round(1e3 * float(modulus.mean), 1), round(1e3 * float(modulus.std), 1)  # mm
    (7.4, 0.3)
    """
    fixed, prior, noise = dict(fixed or {}), dict(prior or {}), noise or Uncertainty()
    if unknown := sorted((fixed.keys() | prior.keys()) - set(SHEAR)):
        raise InputError(f"no soil parameter {unknown[0]!r}; there are: {', '.join(SHEAR)}")
    ranges = {name: prior.get(name, DEFAULT_PRIORS[name]) for name in SHEAR if name not in fixed}
    slopes = len(group_by_slope(climbs, noise.slope)) if climbs else 0
    _refuse_too_few(slopes, list(ranges))
    fixed_modulus = fixed.get("shear_modulus", 0.0)
    modulus_range = ranges.get("shear_modulus") or Prior(fixed_modulus, fixed_modulus)
    balances = ForceBalances.tabulate(rover, climbs, modulus_range)
    posterior = SoilSampler(balances, fixed, ranges, noise).sample(np.random.default_rng(seed))
    shear = posterior.samples.mean(axis=0)
    return GroundEstimate(
        fit=_fit(
            posterior, ranges, len(climbs), slopes, assumed=[n for n in ranges if n not in prior]
        ),
        samples=posterior.samples,
        samples_as_measured=posterior.samples_as_measured,
        rover=estimate_wheel_loads(
            rover, climbs, (float(shear[0]), float(shear[1]), float(shear[2]))
        ),
        noise=noise,
        climb_names=tuple(climb.name for climb in climbs),
        residual=posterior.residual,
        residual_std=posterior.residual_std,
        distinct_slopes=slopes,
    )


def _refuse_too_few(slopes: int, free: list[str]) -> None:
    needed = max(len(free), 1)
    if slopes < needed:
        count = {0: "no climb", 1: "one slope"}.get(slopes, f"{slopes} slopes")
        fixable = [name for name in SHEAR if name in free and name != "shear_modulus"]
        hint = f", or {' or '.join(fixable)} as a number in [soil]" if fixable else ""
        raise FitError(
            f"{count} for {needed} parameters ({', '.join(free)}): each slope adds one equation "
            f"besides that for M; needed are {needed} different slopes{hint}"
        )


def _fit(
    posterior: SoilPosterior,
    ranges: Mapping[str, Prior],
    climbs: int,
    slopes: int,
    assumed: list[str],
) -> Fit:
    free = list(ranges)
    values = posterior.samples[:, [SHEAR.index(name) for name in free]]
    covariance = np.atleast_2d(np.cov(values, rowvar=False)) if free else np.zeros((0, 0))
    fit = Fit(
        method="climbing",
        names=tuple(free),
        units=tuple(QUANTITIES[name].unit for name in free),
        values=values.mean(axis=0),
        covariance=covariance,
        warnings=(),
        rows_used=climbs,
        remaining_fraction={
            n: float(np.std(posterior.u[:, i]) * np.sqrt(12.0)) for i, n in enumerate(free)
        },
        misfit=posterior.misfit,
        channels=("slope_rad",),
    )
    warnings = []
    for name, left in fit.remaining_fraction.items():
        if left > NOT_IDENTIFIED_ABOVE:
            text = f"{name} is not identified: {share_left(left)} its prior width remains"
            warnings.append(Remark("not-identified", text, (name,)))
        elif left > WEAKLY_IDENTIFIED_ABOVE:
            text = f"{name} is weakly identified: {left:.0%} of its prior width remains"
            warnings.append(Remark("weakly-identified", text, (name,)))
    correlation = fit.correlation
    warnings += [
        Remark(
            "trade-off",
            f"{a} and {b} compensate each other (correlation {correlation[i, j]:+.2f}): rely on "
            "the pull that follows from both, not on each value",
            (a, b),
        )
        for i, a in enumerate(free)
        for j, b in enumerate(free)
        if i < j and abs(correlation[i, j]) > STRONG_CORRELATION
    ]
    if posterior.noise_scale > 1.0:
        text = (
            f"the residuals of the force balances are {posterior.noise_scale:.1f} times the noise; "
            "standard deviations are scaled up by the same factor"
        )
        warnings.append(Remark("excess-residuals", text))
    if slopes == 1:
        text = "only one slope: whether the parameters apply on other slopes is not checked"
        warnings.append(Remark("one-slope", text))
    warnings += [
        Remark(
            "assumed-prior",
            f"{name} has neither a value nor a range in [soil]: {ranges[name].lower:g} to "
            f"{ranges[name].upper:g} {QUANTITIES[name].unit} is assumed",
            (name,),
        )
        for name in assumed
    ]
    return replace(fit, warnings=tuple(warnings))
