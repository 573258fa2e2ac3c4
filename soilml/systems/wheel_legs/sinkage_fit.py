"""Soil parameters from the sinkage of a wheel-leg at midstance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from soilml.arrays import Array, Real
from soilml.errors import FitError, InputError
from soilml.systems.wheel_legs.gait_metrics import gait_metrics
from soilml.systems.wheel_legs.geometry import wheel_leg
from soilml.systems.wheel_legs.resistive_force import GROUNDS, LinearGround
from soilml.systems.wheel_legs.soil_errors import SINKAGE, SoilErrors
from soilml.systems.wheel_legs.walk import walk

#: Stiffness of a soil poured loose, raked and vibrated, relative to the raked state; the paper
#: prints the raked state only, the other two are assumed.
STATES: dict[str, float] = {"loose": 0.5, "medium": 1.0, "dense": 2.0}


@dataclass(frozen=True)
class SimulatedSinkage:
    """Midstance sinkage on a set of soils, arrays (cases,)."""

    soil: tuple[str, ...]
    state: tuple[str, ...]
    normal_stiffness: Array  # Pa, sigma_1
    friction_angle: Array  # rad
    sinkage: Array  # m, z_M; NaN where the walk stopped
    status: Array


def simulate_sinkage(*, offset: bool = False) -> SimulatedSinkage:
    """Simulate walks on the four soils in three states (Comin and Saaj 2017, sec. IV-B, fig. 12).

    Normal stress is proportional to depth (eq. 4); with `offset` it starts at sigma_0 (eq. 3).
    """
    cases = [(soil, state) for soil in GROUNDS for state in STATES]
    grounds = [_scaled(GROUNDS[soil], STATES[state]) for soil, state in cases]
    walked_on = grounds if offset else [replace(ground, offset=0.0) for ground in grounds]
    found = gait_metrics(walk(wheel_leg(), walked_on))
    return SimulatedSinkage(
        soil=tuple(soil for soil, _ in cases),
        state=tuple(state for _, state in cases),
        normal_stiffness=np.array([g.normal_stiffness for g in grounds]),
        friction_angle=np.array([g.friction_angle for g in grounds]),
        sinkage=found.midstance_sinkage,
        status=found.status,
    )


def fit_simulated_sinkage(simulated: SimulatedSinkage) -> SinkageFit:
    """Fit both relations to simulated soils."""
    return fit_sinkage(
        simulated.sinkage, simulated.normal_stiffness, simulated.friction_angle, simulated.soil
    )


def _scaled(ground: LinearGround, share: float) -> LinearGround:
    return replace(ground, stiffness=share * ground.stiffness, offset=share * ground.offset)


@dataclass(frozen=True)
class SoilFromSinkage:
    """Soil parameters from sinkage, with standard deviations; arrays of the sinkage's shape.

    `in_range` is false where the sinkage lies outside the range of the fit (extrapolation).
    """

    normal_stiffness: Array  # Pa
    normal_stiffness_std: Array
    friction_angle: Array  # rad
    friction_angle_std: Array
    in_range: Array


@dataclass(frozen=True)
class SinkageFit:
    r"""Relations from midstance sinkage to soil parameters (Comin and Saaj 2017, eq. 29).

    .. math:: \sigma_1 = s_\sigma / z_M, \qquad \varphi = s_I + s_Z z_M

    R^2 is that of the training rows. The scatter is the root mean square error on soils left out
    of the fit (cross-validation by soil), relative for the stiffness. Resistive-force walks do not
    depend on the friction angle: its correlation with sinkage depends on the set of soils alone.
    """

    s_sigma: float  # N/m
    s_i: float  # rad
    s_z: float  # rad/m
    stiffness_r2: float
    friction_r2: float
    stiffness_scatter: float  # share of sigma_1
    friction_scatter: float  # rad
    shallowest: float  # m
    deepest: float
    soil_errors: SoilErrors | None = None  # on known soils, where they are known

    def __call__(self, sinkage: Real, sinkage_std: Real = 0.0) -> SoilFromSinkage:
        """Estimate the soil from sinkage and its standard deviation, m.

        Raises `InputError` for a sinkage that is not above 0."""
        z, std = np.asarray(sinkage, float), np.asarray(sinkage_std, float)
        if np.any(~(z > 0.0)) or np.any(~(std >= 0.0)):
            raise InputError(
                "a midstance sinkage must be above 0 m, and its standard deviation 0 or more"
            )
        stiffness = self.s_sigma / z
        return SoilFromSinkage(
            normal_stiffness=stiffness,
            normal_stiffness_std=stiffness * np.hypot(self.stiffness_scatter, std / z),
            friction_angle=self.s_i + self.s_z * z,
            friction_angle_std=np.hypot(self.friction_scatter, self.s_z * std),
            in_range=(z >= self.shallowest) & (z <= self.deepest),
        )


#: The relations as printed: table VII, and the scatter on the robot from table VIII (9 % of a
#: friction angle of 0.65 rad, 24 % of the stiffness). In range is what gives friction angles
#: between those of the four soils.
PRINTED_SINKAGE = SinkageFit(
    s_sigma=339.0,
    s_i=0.76,
    s_z=-7.0,
    stiffness_r2=0.77,
    friction_r2=0.98,
    stiffness_scatter=0.24,
    friction_scatter=0.06,
    shallowest=0.002,
    deepest=0.036,
    soil_errors=SINKAGE,
)


def fit_sinkage(
    sinkage: Sequence[float] | Array,
    normal_stiffness: Sequence[float] | Array,
    friction_angle: Sequence[float] | Array,
    soil: Sequence[str],
) -> SinkageFit:
    """Fit both relations by least squares to rows of known soils; rows with NaN are ignored.

    Parameters
    ----------
    sinkage
        Midstance sinkage, m (rows,).
    normal_stiffness, friction_angle
        sigma_1, Pa, and phi, rad, of the soils (rows,).
    soil
        Name of the soil of each row, for the cross-validation.

    Raises
    ------
    FitError
        For fewer than three soils, or sinkages that are all equal or not above 0.

    Examples
    --------
    >>> z = np.array([0.01, 0.02, 0.03, 0.05])
    >>> fit = fit_sinkage(z, 400.0 / z, 0.8 - 6.0 * z, list("abcd"))
    >>> round(float(fit(0.02).normal_stiffness))  # Pa
    20000
    """
    rows = np.array([sinkage, normal_stiffness, friction_angle], float)
    usable = np.all(np.isfinite(rows), axis=0)
    (z, stiffness, friction), soils = rows[:, usable], np.array(soil)[usable]
    names = sorted(set(soils.tolist()))
    if len(names) < 3 or np.any(z <= 0.0) or np.ptp(z) == 0.0:
        raise FitError(
            f"rows of {len(names)} soils: needed are three or more, with different sinkages above 0"
        )
    s_sigma, s_i, s_z = _fit_relations(z, stiffness, friction)
    stiffness_error, friction_error = np.empty_like(z), np.empty_like(z)
    for name in names:
        left_out = soils == name
        slope, level, tilt = _fit_relations(z[~left_out], stiffness[~left_out], friction[~left_out])
        stiffness_error[left_out] = stiffness[left_out] * z[left_out] / slope - 1.0
        friction_error[left_out] = friction[left_out] - level - tilt * z[left_out]
    return SinkageFit(
        s_sigma=s_sigma,
        s_i=s_i,
        s_z=s_z,
        stiffness_r2=_r_squared(stiffness - s_sigma / z, stiffness),
        friction_r2=_r_squared(friction - s_i - s_z * z, friction),
        stiffness_scatter=float(np.sqrt(np.mean(stiffness_error**2))),
        friction_scatter=float(np.sqrt(np.mean(friction_error**2))),
        shallowest=float(z.min()),
        deepest=float(z.max()),
    )


def _fit_relations(z: Array, stiffness: Array, friction: Array) -> tuple[float, float, float]:
    """s_sigma, s_I and s_Z by least squares."""
    s_z, s_i = np.polyfit(z, friction, 1)
    return float(np.sum(stiffness / z) / np.sum(1.0 / z**2)), float(s_i), float(s_z)


def _r_squared(residual: Array, values: Array) -> float:
    total = float(np.sum((values - values.mean()) ** 2))
    return 1.0 - float(np.sum(residual**2)) / total if total > 0.0 else 0.0
