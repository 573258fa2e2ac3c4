"""Linear models from torque or vibration of a wheel-leg to slip and soil, and fits of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Generic, TypeVar, final

import numpy as np

from soilml.arrays import Floats
from soilml.errors import FitError, InputError
from soilml.systems.wheel_legs.soil_errors import (
    EMPIRICAL,
    LINEAR,
    PLANAR,
    SIMPLIFIED,
    SoilErrors,
)

Real = float | Floats

#: 1 N/cm^2 in Pa, 1 kN/m in N/m, 1 g in m/s^2: units of the printed coefficients.
PRESSURE, STIFFNESS, GRAVITY = 1e4, 1e3, 9.81


@final
@dataclass(frozen=True, kw_only=True)
class TorqueSlip:
    r"""Slip from the motor torque at midstance, i_T = a + b T, and the soil from a and b.

    .. math::
        \varphi = c_\tau + b_\tau b + a_\tau a, \quad \sigma_1 = c_\sigma + b_\sigma b + a_\sigma a

    Coefficients in rad, N/cm^2 and N m as printed; methods use SI units. sigma_1 is the
    linearised normal stress at 1 cm depth, sigma_0 + alpha_z (1 cm). With `intercept` a is constant
    over all soils, and sigma_1 follows from b. References: Comin and Saaj 2017, eqs. 18, 19
    and 27, table IV. Valid for a five-legged wheel-leg with Load Testing Feet under a similar load.
    """

    friction: tuple[float, float, float]  # c_tau, b_tau, a_tau
    stiffness: tuple[float, float, float]  # c_sigma, b_sigma, a_sigma
    slip_std: float  # standard error of the slip
    intercept: float | None = None
    soil_errors: SoilErrors | None = None  # on known soils, where they are known

    @property
    def matrix(self) -> Floats:
        """Phi (2, 3): (a, b) = Phi (1, phi in rad, sigma_1 in N/cm^2), eq. 19, inverted exactly."""
        c_tau, b_tau, a_tau = self.friction
        if self.intercept is not None:
            return np.asarray([[self.intercept, 0, 0], [-c_tau / b_tau, 1 / b_tau, 0]])
        c_sigma, b_sigma, a_sigma = self.stiffness
        inverse = np.linalg.inv([[a_tau, b_tau], [a_sigma, b_sigma]])
        return np.column_stack([-inverse @ [c_tau, c_sigma], inverse])

    def line(self, friction_angle: Real, normal_stiffness: Real) -> tuple[Floats, Floats]:
        """Intercept a and slope b (1/(N m)) on a soil of this angle (rad) and stiffness (Pa)."""
        return _line(self.matrix, friction_angle, np.asarray(normal_stiffness) / PRESSURE)

    def slip(self, torque: Real, friction_angle: Real, normal_stiffness: Real) -> Floats:
        """Slip at a torque (N m) on a known soil."""
        a, b = self.line(friction_angle, normal_stiffness)
        return np.asarray(a + b * torque)

    def soil(self, intercept: Real, slope: Real) -> tuple[Floats, Floats]:
        """(friction angle in rad, normal stiffness in Pa) from intercept and slope, eq. 27."""
        rows = np.asarray([self.friction, self.stiffness]) * [[1.0], [PRESSURE]]
        angle, stiffness = (
            c + b * np.asarray(slope) + a * np.asarray(intercept) for c, b, a in rows
        )
        return angle, stiffness


@final
@dataclass(frozen=True, kw_only=True)
class VibrationSlip:
    r"""Slip from the vibration of the hub after midstance, i_V = a + b \Delta a.

    .. math:: a = c_I + c_\mu \Delta\varphi + c_K k_S, \quad b = a_\mu + b_\mu \Delta\varphi

    with the drop of friction in degrees, k_S in kN/m and the vibration in g; methods use SI
    units. References: Comin and Saaj 2017, eqs. 24, 25 and 27, table V, which prints `rad^-1`; in
    radians the drop of friction would have no effect on the slip. With c_K = 0 the model does not
    determine k_S, which is then `assumed`.
    """

    c_i: float
    c_mu: float  # 1/degree
    c_k: float  # m/kN
    a_mu: float  # 1/g
    b_mu: float  # 1/(g degree)
    slip_std: float
    assumed: float | None = None  # N/m, k_S where c_K = 0
    soil_errors: SoilErrors | None = None  # on known soils, where they are known

    @property
    def matrix(self) -> Floats:
        """Phi (2, 3): (a, b) = Phi (1, drop of friction in degrees, k_S in kN/m), eq. 25."""
        return np.asarray([[self.c_i, self.c_mu, self.c_k], [self.a_mu, self.b_mu, 0.0]])

    def line(self, increment: Real, stiffness: Real) -> tuple[Floats, Floats]:
        """Intercept a and slope b (s^2/m) for a drop of friction (rad) and k_S (N/m)."""
        a, b = _line(self.matrix, np.rad2deg(increment), np.asarray(stiffness) / STIFFNESS)
        return a, b / GRAVITY

    def slip(self, vibration: Real, increment: Real, stiffness: Real) -> Floats:
        """Slip at a vibration (m/s^2), for a known drop of friction (rad) and k_S (N/m)."""
        a, b = self.line(increment, stiffness)
        return np.asarray(a + b * vibration)

    def spring(self, intercept: Real, slope: Real) -> tuple[Floats, Floats]:
        """(drop of friction in rad, k_S in N/m) from intercept and slope, eq. 27."""
        if self.assumed is not None:
            raise InputError("a model without c_K does not determine k_S; use the planar model")
        drop = (np.asarray(slope) * GRAVITY - self.a_mu) / self.b_mu
        stiffness = (np.asarray(intercept) - self.c_i - self.c_mu * drop) / self.c_k
        return np.deg2rad(drop), stiffness * STIFFNESS

    def drop(self, vibration: Real, slip: Real) -> Floats:
        """Drop of friction (rad) from one vibration (m/s^2) and slip, for c_K = 0."""
        if self.assumed is None:
            raise InputError(
                "one pair does not determine both k_S and the drop; use the linear model"
            )
        in_g = np.asarray(vibration) / GRAVITY
        remainder = np.asarray(slip) - self.c_i - self.a_mu * in_g
        return np.asarray(np.deg2rad(remainder / (self.c_mu + self.b_mu * in_g)))


def spring_soil(increment: Real, stiffness: Real) -> tuple[Floats, Floats]:
    r"""(friction angle in rad, normal stiffness in Pa) from drop of friction (rad) and k_S (N/m).

    .. math::
        \varphi_V = -0.76 + 0.35 k_S + 0.03 \Delta\varphi, \quad
        \sigma_{1,V} = -0.2 - 0.81 k_S' + 13.45 \Delta\varphi'

    with k_S in kN/m and the drop in degrees in the first, k_S' in N/cm and the drop in radians in
    the second: t_K is printed in cm^-1 and t_tau in N/cm^2/rad. Only with these units do all four
    soils have a spring (0.78 to 0.96 kN/m, 33 to 40 degrees) whose slip lies between 0 and 0.5 for
    vibrations of some tenths of g. References: Comin and Saaj 2017, eq. 28, table VII.
    """
    k, drop = np.asarray(stiffness), np.asarray(increment)
    angle = -0.76 + 0.35 * k / 1e3 + 0.03 * np.rad2deg(drop)
    return angle, (-0.2 - 0.81 * k / 100.0 + 13.45 * drop) * PRESSURE


def soil_spring(friction_angle: Real, normal_stiffness: Real) -> tuple[Floats, Floats]:
    """(drop of friction in rad, k_S in N/m) of a soil: the exact inverse of `spring_soil`."""
    rows = np.asarray([[0.03 * 180.0 / np.pi, 0.35 / 1e3], [13.45, -0.81 / 100.0]])
    inverse = np.linalg.inv(rows)
    angle = np.asarray(friction_angle) + 0.76
    stiffness = np.asarray(normal_stiffness) / PRESSURE + 0.2
    drop, spring = (row[0] * angle + row[1] * stiffness for row in inverse)
    return drop, spring


def _line(matrix: Floats, first: Real, second: Real) -> tuple[Floats, Floats]:
    a, b = (c + p * np.asarray(first) + q * np.asarray(second) for c, p, q in matrix)
    return a, b


_SHEAR, _NORMAL = (1.0, -0.58, 0.0), (-0.7, 20.928, 15.997)

#: Table IV, with the variances of slip of table VI and the errors of table VIII.
TORQUE_SLIP: dict[str, TorqueSlip] = {
    "terramechanics": TorqueSlip(
        friction=(0.661, -0.466, -0.377), stiffness=(-0.356, 1.434, 0.0), slip_std=0.074**0.5,
        soil_errors=EMPIRICAL,
    ),
    "empirical": TorqueSlip(
        friction=_SHEAR, stiffness=_NORMAL, slip_std=0.005**0.5, soil_errors=EMPIRICAL
    ),
    "simplified": TorqueSlip(
        friction=_SHEAR, stiffness=_NORMAL, slip_std=0.018**0.5, intercept=-0.33,
        soil_errors=SIMPLIFIED,
    ),
}  # fmt: skip

#: Table V, with the variances of slip of table VI. Without c_K the intercept is that of the
#: planar model at one stiffness, c_I' = c_I + c_K k_S.
VIBRATION_SLIP: dict[str, VibrationSlip] = {
    "planar": VibrationSlip(
        c_i=-1.434, c_mu=0.022, c_k=0.789, a_mu=6.609, b_mu=-0.156, slip_std=0.015**0.5,
        soil_errors=PLANAR,
    ),
    "linear": VibrationSlip(
        c_i=-0.882, c_mu=0.022, c_k=0.0, a_mu=6.609, b_mu=-0.156, slip_std=0.020**0.5,
        assumed=(1.434 - 0.882) / 0.789 * STIFFNESS, soil_errors=LINEAR,
    ),
}  # fmt: skip


Law = TypeVar("Law", TorqueSlip, VibrationSlip)


def find_slip_model(model: str | Law, catalogue: Mapping[str, Law]) -> Law:
    """A model as it is, or the one of this name; raises `InputError` for an unknown name."""
    if not isinstance(model, str):
        return model
    if model not in catalogue:
        raise InputError(f"no slip model {model!r}; there are: {', '.join(catalogue)}")
    return catalogue[model]


@dataclass(frozen=True)
class SlipModelFit(Generic[Law]):
    """A fitted slip model, and R^2 of its parts by name."""

    law: Law
    goodness: dict[str, float]


def fit_lines(reading: Floats, slip: Floats) -> tuple[Floats, Floats, Floats]:
    """Regress slip (slips,) on a reading (slips, soils): intercepts, slopes and R^2, (soils,)."""
    slips = np.broadcast_to(np.asarray(slip, float)[:, None], reading.shape)
    x, y = reading - reading.mean(axis=0), slips - slips.mean(axis=0)
    with np.errstate(invalid="ignore"):  # a reading that is equal at all slips has no slope: NaN
        slope = (x * y).sum(axis=0) / (x * x).sum(axis=0)
    residual = ((y - slope * x) ** 2).sum(axis=0)
    return (
        slips.mean(axis=0) - slope * reading.mean(axis=0),
        slope,
        1.0 - residual / (y * y).sum(axis=0),
    )


def fit_torque_slip(
    torque: Floats, slip: Floats, friction_angle: Floats, normal_stiffness: Floats, form: str
) -> SlipModelFit[TorqueSlip]:
    """Fit eqs. 18 and 27 to torques (N m), (slips, soils), on soils of known properties (SI).

    `form` determines which coefficient is zero: a_sigma for `terramechanics`, a_tau for
    `empirical`, as printed in table IV of Comin and Saaj 2017; four soils leave one degree of
    freedom.
    """
    a, b, straight = fit_lines(torque, slip)
    _check_finite(a, b)
    both = form == "terramechanics"
    friction, gof_friction = _plane(friction_angle, b, a if both else None)
    stiffness, gof_stiffness = _plane(normal_stiffness / PRESSURE, b, None if both else a)
    error = np.asarray(slip)[:, None] - a - b * torque
    law = TorqueSlip(friction=friction, stiffness=stiffness, slip_std=float(np.std(error)))
    goodness = {"slip": float(np.median(straight)), "friction": gof_friction}
    return SlipModelFit(law, goodness | {"stiffness": gof_stiffness})


def fit_vibration_slip(
    vibration: Floats, slip: Floats, increment: Floats, stiffness: Floats, planar: bool
) -> SlipModelFit[VibrationSlip]:
    """Fit eqs. 24 and 25 to vibrations (m/s^2), (slips, springs), of known springs (SI)."""
    a, b, straight = fit_lines(vibration, slip)
    _check_finite(a, b)
    drop, spring = np.rad2deg(increment), stiffness / STIFFNESS
    (c_i, c_mu, c_k), gof_a = _plane(a, drop, spring if planar else None)
    (a_mu, b_mu, _), gof_b = _plane(b * GRAVITY, drop, None)
    error = np.asarray(slip)[:, None] - a - b * vibration
    law = VibrationSlip(
        c_i=c_i, c_mu=c_mu, c_k=c_k, a_mu=a_mu, b_mu=b_mu, slip_std=float(np.std(error)),
        assumed=None if planar else float(np.mean(stiffness)),
    )  # fmt: skip
    return SlipModelFit(
        law, {"slip": float(np.median(straight)), "intercept": gof_a, "slope": gof_b}
    )


def _plane(
    y: Floats, first: Floats, second: Floats | None
) -> tuple[tuple[float, float, float], float]:
    """Coefficients of y = c + p first + q second (q = 0 without a second), and R^2."""
    columns = [np.ones_like(first), first] + ([] if second is None else [second])
    coefficients, *_ = np.linalg.lstsq(np.column_stack(columns), y, rcond=None)
    residual = y - np.column_stack(columns) @ coefficients
    c, p, q = (*coefficients, 0.0)[:3]
    return (float(c), float(p), float(q)), 1.0 - float(
        residual @ residual / np.sum((y - y.mean()) ** 2)
    )


def _check_finite(a: Floats, b: Floats) -> None:
    invalid = ~(np.isfinite(a) & np.isfinite(b))
    if invalid.any():
        raise FitError(
            f"{invalid.sum()} of {invalid.size} soils have no slip model: a stance without "
            "equilibrium, or readings that are equal at all slips; leave those soils out"
        )
