"""The soil from how deep a wheel-leg sinks at midstance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from soilml.arrays import Array, Real
from soilml.errors import FitError, InputError
from soilml.systems.wheel_legs.walking.gait_metrics import gait
from soilml.systems.wheel_legs.walking.geometry import WheelLeg, wheel_leg
from soilml.systems.wheel_legs.walking.linear_ground import GROUNDS, Ground
from soilml.systems.wheel_legs.walking.walk import walk

#: Stiffness of a soil poured loose, raked and vibrated, as shares of the raked one; the paper
#: prints the raked one only, the other two are assumed.
STATES: dict[str, float] = {"loose": 0.5, "medium": 1.0, "dense": 2.0}


@dataclass(frozen=True)
class Simulated:
    """Midstance sinkage on a set of grounds, rows side by side, (cases,)."""

    soil: tuple[str, ...]
    state: tuple[str, ...]
    normal_stiffness: Array  # Pa, sigma_1
    friction_angle: Array  # rad
    sinkage: Array  # m, z_M; NaN where the walk stopped
    status: Array


def simulated(wheel: WheelLeg | None = None, *, offset: bool = False) -> Simulated:
    """Walk the four soils in three states (Comin and Saaj 2017, section IV-B, fig. 12).

    Normal stress is proportional to depth (eq. 4), with `offset` it starts at sigma_0 (eq. 3).
    """
    cases = [(soil, state) for soil in GROUNDS for state in STATES]
    grounds = [_prepared(GROUNDS[soil], STATES[state]) for soil, state in cases]
    under = grounds if offset else [replace(ground, offset=0.0) for ground in grounds]
    found = gait(walk(wheel_leg() if wheel is None else wheel, under))
    return Simulated(
        soil=tuple(soil for soil, _ in cases),
        state=tuple(state for _, state in cases),
        normal_stiffness=np.array([g.normal_stiffness for g in grounds]),
        friction_angle=np.array([g.friction_angle for g in grounds]),
        sinkage=found.midstance_sinkage,
        status=found.status,
    )


def fitted_to(rows: Simulated) -> SinkageFit:
    """The lines fitted to simulated soils."""
    return fitted(rows.sinkage, rows.normal_stiffness, rows.friction_angle, rows.soil)


def _prepared(ground: Ground, share: float) -> Ground:
    return replace(ground, stiffness=share * ground.stiffness, offset=share * ground.offset)


@dataclass(frozen=True)
class SoilFromSinkage:
    """What sinkage says of the soil, with standard deviations; arrays of the sinkage's shape.

    `in_range` is false where the sinkage lies outside what the fit has seen: do not believe it.
    """

    normal_stiffness: Array  # Pa
    normal_stiffness_std: Array
    friction_angle: Array  # rad
    friction_angle_std: Array
    in_range: Array


@dataclass(frozen=True)
class SinkageFit:
    r"""Two lines from midstance sinkage to soil (Comin and Saaj 2017, eq. 29).

    .. math:: \sigma_1 = s_\sigma / z_M, \qquad \varphi = s_I + s_Z z_M

    R^2 is the share of the variance that a line explains in the rows it was fitted to. The
    scatter is what it misses, root mean square, on soils that were left out of the fit: relative
    for the stiffness. Resistive-force walks do not depend on the friction angle: what relates it
    to sinkage is only which soils happen to be in the set.
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

    def __call__(self, sinkage: Real, sinkage_std: Real = 0.0) -> SoilFromSinkage:
        """Soil from sinkage and its standard deviation, m; `InputError` where it is not above 0."""
        z, std = np.asarray(sinkage, float), np.asarray(sinkage_std, float)
        if np.any(~(z > 0.0)) or np.any(~(std >= 0.0)):
            raise InputError("a midstance sinkage must be above 0 m, and its deviation 0 or more")
        stiffness = self.s_sigma / z
        return SoilFromSinkage(
            normal_stiffness=stiffness,
            normal_stiffness_std=stiffness * np.hypot(self.stiffness_scatter, std / z),
            friction_angle=self.s_i + self.s_z * z,
            friction_angle_std=np.hypot(self.friction_scatter, self.s_z * std),
            in_range=(z >= self.shallowest) & (z <= self.deepest),
        )


def fitted(
    sinkage: Sequence[float] | Array,
    normal_stiffness: Sequence[float] | Array,
    friction_angle: Sequence[float] | Array,
    soil: Sequence[str],
) -> SinkageFit:
    """Least squares of both lines on rows of known soils, named in `soil`; those with NaN are out.

    Raises `FitError` for fewer than three soils, or sinkages that are all alike or not above 0.
    """
    rows = np.array([sinkage, normal_stiffness, friction_angle], float)
    usable = np.all(np.isfinite(rows), axis=0)
    (z, stiffness, friction), soils = rows[:, usable], np.array(soil)[usable]
    names = sorted(set(soils.tolist()))
    if len(names) < 3 or np.any(z <= 0.0) or np.ptp(z) == 0.0:
        raise FitError(
            f"rows of {len(names)} soils: give three soils or more, of different sinkages above 0"
        )
    s_sigma, s_i, s_z = _lines(z, stiffness, friction)
    missed_stiffness, missed_friction = np.empty_like(z), np.empty_like(z)
    for name in names:
        out = soils == name
        slope, level, tilt = _lines(z[~out], stiffness[~out], friction[~out])
        missed_stiffness[out] = stiffness[out] * z[out] / slope - 1.0
        missed_friction[out] = friction[out] - level - tilt * z[out]
    return SinkageFit(
        s_sigma=s_sigma,
        s_i=s_i,
        s_z=s_z,
        stiffness_r2=_explained(stiffness - s_sigma / z, stiffness),
        friction_r2=_explained(friction - s_i - s_z * z, friction),
        stiffness_scatter=float(np.sqrt(np.mean(missed_stiffness**2))),
        friction_scatter=float(np.sqrt(np.mean(missed_friction**2))),
        shallowest=float(z.min()),
        deepest=float(z.max()),
    )


def _lines(z: Array, stiffness: Array, friction: Array) -> tuple[float, float, float]:
    """s_sigma, s_I and s_Z by least squares."""
    s_z, s_i = np.polyfit(z, friction, 1)
    return float(np.sum(stiffness / z) / np.sum(1.0 / z**2)), float(s_i), float(s_z)


def _explained(rest: Array, values: Array) -> float:
    total = float(np.sum((values - values.mean()) ** 2))
    return 1.0 - float(np.sum(rest**2)) / total if total > 0.0 else 0.0
