"""Cohesion, friction angle and shear modulus from climbs of several slopes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from soilml.arrays import Floats
from soilml.errors import FitError, InputError
from soilml.fitting.misfit import misfit_limit
from soilml.identification.fit import Fit, identifiability_remarks, trade_offs
from soilml.numerics.importance_sampling import importance_sample
from soilml.numerics.prior import Prior
from soilml.quantities import QUANTITIES, SHEAR
from soilml.remarks import Remark
from soilml.systems.rim_stress.climbs import (
    Climb,
    ForceBalances,
    Rover,
    ShearParameters,
    Uncertainty,
    count_apart,
)
from soilml.systems.rim_stress.force_balance import magnification, unit_remarks

#: Priors of the shear parameters of sands, used where neither a value nor a range is given.
DEFAULT_PRIORS = {
    "cohesion": Prior(0.0, 2000.0),
    "friction_angle": Prior(0.35, 0.87),
    "shear_modulus": Prior(0.001, 0.05, log=True),
}
#: Posterior samples returned; iterations in which the noise covariance, which depends on the soil,
#: is updated at the current centre. Three suffice: it changes little over the posterior.
SAMPLES, ITERATIONS = 6000, 3
MAX_NOISE_SCALE = 5.0  # Climbs are refused if the noise would have to be this many times larger
#: Slopes that differ by less than this many standard deviations of a difference, or than about half
#: a degree (rad), are one condition.
SLOPE_SIGMAS, MIN_SLOPE_DIFFERENCE = 3.0, 0.009


@dataclass(frozen=True)
class GroundEstimate:
    """Soil parameters estimated from climbs, and the residual of each climb.

    `samples_as_measured` are consistent with the stresses as measured: an error of the entry angles
    common to all runs affects stresses and k_x, and the two effects nearly cancel in the pull.
    """

    fit: Fit
    samples: Floats  # (n, 3): c (Pa), phi (rad), k_x (m); fixed parameters are constant
    samples_as_measured: Floats  # (n, 3)
    rover: Rover
    noise: Uncertainty
    residual: Floats  # (climbs,) N, pull less the weight along the slope, at the posterior mean
    residual_std: Floats  # (climbs,) N
    distinct_slopes: int

    @property
    def shear(self) -> ShearParameters:
        """Posterior mean of (c, phi, k_x)."""
        return _shear(self.samples.mean(axis=0))


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

    The second equation gives M of each wheel in closed form; the first is then one equation for
    each run, weighted by the noise of its balance (`balance_std`). The posterior mean and
    covariance are the estimate. Repeated climbs of one slope are one condition: p parameters need p
    slopes.

    Parameters
    ----------
    rover
        Mass, wheels and centre of mass.
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
        For too few slopes, and for climbs that no single soil of the prior explains.
    InputError
        For an unknown parameter.

    References
    ----------
    Nagatani et al., section 6.
    """
    fixed, prior, noise = dict(fixed or {}), dict(prior or {}), noise or Uncertainty()
    if unknown := sorted((fixed.keys() | prior.keys()) - set(SHEAR)):
        raise InputError(f"no soil parameter {unknown[0]!r}; there are: {', '.join(SHEAR)}")
    ranges = {name: prior.get(name, DEFAULT_PRIORS[name]) for name in SHEAR if name not in fixed}
    tolerance = max(SLOPE_SIGMAS * np.sqrt(2.0) * noise.slope_rad, MIN_SLOPE_DIFFERENCE)
    slopes = count_apart([climb.slope for climb in climbs], float(tolerance))
    free = list(ranges)
    _refuse_too_few(slopes, free)
    constant = fixed.get("shear_modulus", 0.0)
    within = ranges.get("shear_modulus") or Prior(constant, constant)
    balances, rng = ForceBalances.tabulate(rover, climbs, within), np.random.default_rng(seed)

    def soils(u: Floats) -> Floats:
        """(c, phi, k_x) (n, 3) at fractions (n, p) of the priors."""
        drawn = {name: ranges[name].at(u[:, i]) for i, name in enumerate(free)}
        return np.stack([drawn.get(n, np.full(len(u), fixed.get(n, 0.0))) for n in SHEAR], axis=1)

    def draw(whitener: Floats) -> Floats:
        """Posterior samples (n, p) of the fractions, for Gaussian residuals whitened as given."""
        if not free:
            return np.zeros((SAMPLES, 1))

        def log_density(u: Floats) -> Floats:
            squares = ((balances.residuals(soils(u)) @ whitener.T) ** 2).sum(axis=1)
            return np.where(np.isnan(squares), -np.inf, -0.5 * squares)

        drawn = importance_sample(log_density, len(free), int(rng.integers(2**31)))
        return drawn.u[rng.choice(len(drawn.u), SAMPLES, p=drawn.weights)]

    whitener, _ = balances.whitener(_shear(soils(np.full((1, len(free)), 0.5))[0]), noise)
    freedom, noise_scale = max(len(climbs) - len(free), 1), 1.0
    for _ in range(ITERATIONS):
        u = draw(whitener / noise_scale)
        centre = soils(u).mean(axis=0)
        whitener, std = balances.whitener(_shear(centre), noise)
        residual = balances.residuals(centre[None])[0]
        misfit = float(np.sum((whitener @ residual) ** 2)) / freedom
        noise_scale = float(np.sqrt(misfit)) if misfit > misfit_limit(freedom) else 1.0
    _refuse_contradiction(balances, residual, std, noise_scale)
    as_measured, _ = balances.whitener(_shear(centre), replace(noise, entry_angle_rad=0.0))
    samples = soils(u)
    values = samples[:, [SHEAR.index(name) for name in free]]
    fit = Fit(
        method="climbing",
        names=tuple(free),
        units=tuple(QUANTITIES[name].unit for name in free),
        values=values.mean(axis=0),
        covariance=np.atleast_2d(np.cov(values, rowvar=False)) if free else np.zeros((0, 0)),
        warnings=(),
        rows_used=len(climbs),
        remaining_fraction={n: float(np.std(u[:, i]) * np.sqrt(12.0)) for i, n in enumerate(free)},
        misfit=misfit,
        channels=("slope_rad",),
    )
    cohesion, friction, modulus = _shear(centre)
    scales = [
        magnification(parts, load, cohesion, np.tan(friction))
        for climb in climbs
        for parts, load in zip(
            rover.parts(climb.wheels, modulus), rover.loads(climb.slope), strict=True
        )
    ]
    assumed = {name: ranges[name] for name in free if name not in prior}
    warnings = _warnings(fit, noise_scale, assumed) + unit_remarks(np.asarray(scales))
    return GroundEstimate(
        fit=replace(fit, warnings=tuple(warnings)),
        samples=samples,
        samples_as_measured=soils(draw(as_measured / noise_scale)),
        rover=rover,
        noise=noise,
        residual=residual,
        residual_std=std,
        distinct_slopes=slopes,
    )


def _shear(values: Floats) -> ShearParameters:
    return float(values[0]), float(values[1]), float(values[2])


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


def _refuse_contradiction(
    balances: ForceBalances, residual: Floats, std: Floats, noise_scale: float
) -> None:
    """Raise `FitError` if no single soil explains all climbs, naming the largest outlier."""
    if noise_scale > MAX_NOISE_SCALE:
        i = int(np.argmax(np.abs(residual) / std))
        raise FitError(
            f"no single soil within the ranges explains these climbs: their force balances miss by "
            f"{noise_scale:.0f} times the noise, run {balances.climbs[i].name} by "
            f"{residual[i]:+.3g} N; check slope_rad (rad, positive uphill), slip, angle_rad "
            "(positive forward), the mass, [soil.prior] and [noise]"
        )


def _warnings(fit: Fit, noise_scale: float, assumed: Mapping[str, Prior]) -> list[Remark]:
    """What limits the estimate."""
    found = [
        remark
        for name, left in fit.remaining_fraction.items()
        for remark in identifiability_remarks(name, left)
    ]
    found += trade_offs(fit)
    if noise_scale > 1.0:
        text = (
            f"the residuals of the force balances are {noise_scale:.1f} times the noise; standard "
            "deviations are scaled up by the same factor"
        )
        found.append(Remark("excess-residuals", text))
    for name, range_ in assumed.items():
        text = (
            f"{name} has neither a value nor a range in [soil]: {range_.lower:g} to "
            f"{range_.upper:g} {QUANTITIES[name].unit} is assumed"
        )
        found.append(Remark("assumed-prior", text, (name,)))
    return found
