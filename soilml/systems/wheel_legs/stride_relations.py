"""Linear relations of a wheel-leg's torque, vibration and sinkage to slip and soil, as printed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from soilml.arrays import Floats
from soilml.errors import FitError, InputError

Real = float | Floats

#: 1 N/cm^2 in Pa, 1 kN/m in N/m, 1 g in m/s^2, 1 rad in degrees: units of printed coefficients.
PRESSURE, STIFFNESS, GRAVITY, DEGREE = 1e4, 1e3, 9.81, 180.0 / np.pi
MAX_EXCESS = 3.0  # Standard deviations from the physical range at which an estimate is refused
_Soils = tuple[float, float, float, float]


@final
@dataclass(frozen=True)
class SoilErrors:
    """Errors of friction angle and normal stiffness in %, as printed (table VIII).

    friction, stiffness: Mean errors on SSC-1, SSC-2, SSC-3 and ES-3. All strides on a soil share
        them, so that more strides do not lessen them.
    scatter: Standard deviations of both over the strides on all soils, which weigh the sensors.
    """

    friction: _Soils
    stiffness: _Soils
    scatter: tuple[float, float]


#: Of torque by the simplified relation, of vibration by the linear one, and of sinkage.
TORQUE_ERRORS = SoilErrors((-7, -9, 21, 4), (36, -6, -92, -11), (14.0, 54.0))
VIBRATION_ERRORS = SoilErrors((1, 3, 5, 23), (-27, -50, -4, -78), (14.0, 27.0))
SINKAGE_ERRORS = SoilErrors((-17, -8, 4, 2), (30, 24, -5, -17), (9.0, 24.0))


@dataclass(frozen=True)
class LegSoil:
    """Friction angle (rad) and stiffness sigma_1 (Pa) of one soil by one sensor, `mean` (2,).

    `of_strides` (2, 2) is the covariance by the residual scatter of the relation and the noise of
    the sensor, which more strides lessen; `errors`, the relation's on known soils, they do not.
    """

    mean: Floats
    of_strides: Floats
    errors: SoilErrors

    @property
    def deviations(self) -> Floats:
        """The errors that all strides on a soil share, (2, soils), scaled to unit variance."""
        shares = 0.01 * np.asarray([self.errors.friction, self.errors.stiffness])
        return np.asarray(shares * self.mean[:, None] / 2.0)

    @property
    def std(self) -> Floats:
        """Standard deviations of both (2,); too small for another wheel-leg."""
        return np.sqrt(np.diag(self.of_strides + self.deviations @ self.deviations.T))


@dataclass(frozen=True, kw_only=True)
class SlipLine:
    """Slip from a reading x (SI) of a stride, i = a + b x, (a, b) = of_soil (1, phi, sigma_1)."""

    of_soil: Floats  # (2, 3)
    slip_std: float  # standard error of the slip, table VI

    def line(self, friction_angle: Real, normal_stiffness: Real) -> tuple[Floats, Floats]:
        """Intercept and slope on a soil of this angle (rad) and stiffness (Pa)."""
        return affine(self.of_soil, friction_angle, normal_stiffness)


@final
@dataclass(frozen=True, kw_only=True)
class StrideRelation(SlipLine):
    r"""A line with one number y of the soil, which a single stride determines.

    .. math:: i = p + q x + y (r + s x)

    at_none: (p, q). rate: (r, s).
    to_soil (2, 2): (phi, sigma_1) = to_soil (1, y).

    References: Comin and Saaj 2017, eqs. 18, 19, 24, 25, 27 and 28, tables IV to VIII. Valid for a
    five-legged wheel-leg with Load Testing Feet under a similar load, at slips of 0 to 0.5.
    """

    at_none: tuple[float, float]
    rate: tuple[float, float]
    to_soil: Floats
    errors: SoilErrors

    def soil(self, reading: Real, slip: Real) -> LegSoil:
        """Estimate the soil from readings (SI) and slips, one pair (n,) for each stride.

        Raises `InputError` for pairs that are not valid, `FitError` if they do not determine the
        soil or the estimate is not physical.
        """
        x, i = (np.atleast_1d(np.asarray(v, float)) for v in (reading, slip))
        _check_pairs(x, i)
        rate = self.rate[0] + self.rate[1] * x
        if np.any(rate == 0.0):
            raise FitError("a reading of zero does not determine the soil; leave that pair out")
        information = (rate / self.slip_std) ** 2
        each = (i - self.at_none[0] - self.at_none[1] * x) / rate
        mean = self.to_soil @ [1.0, (each * information).sum() / information.sum()]
        std = self.to_soil[:, 1] / np.sqrt(information.sum())
        margin = MAX_EXCESS * np.abs(std)
        if not -margin[0] <= mean[0] <= 0.5 * np.pi + margin[0] or mean[1] < -margin[1]:
            raise FitError(
                f"these pairs give a friction angle of {mean[0]:.3g} rad and a stiffness of "
                f"{mean[1]:.3g} Pa, which is not physical: the model is not valid for them"
            )
        return LegSoil(mean, np.outer(std, std), self.errors)


def _check_pairs(x: Floats, i: Floats) -> None:
    if x.ndim != 1 or x.shape != i.shape or x.size == 0:
        raise InputError(f"{x.size} readings and {i.size} slips are given; needed are pairs")
    if not (np.isfinite(x).all() and np.isfinite(i).all()):
        raise InputError("a reading or a slip is not a number; leave that pair out")
    if np.abs(i).max() > 1.0:
        raise InputError(
            f"slip is {i[np.abs(i).argmax()]:g}; it must lie between -1 and 1 (a fraction, not "
            "percent)"
        )


#: (phi, sigma_1) = SPRING (1, drop of friction in rad, k_S in N/m), eq. 28 and table VII. t_K is
#: printed in cm^-1 and t_tau in N/cm^2/rad; the drop is in degrees for the angle. Only with these
#: units do all four soils have a spring (0.78 to 0.96 kN/m, 33 to 40 degrees) whose slip lies
#: between 0 and 0.5 for vibrations of some tenths of g.
SPRING = np.asarray(
    [[-0.76, 0.03 * DEGREE, 0.35 / STIFFNESS], [-0.2e4, 13.45e4, -0.81 * PRESSURE / 100.0]]
)


def _inverse(matrix: Floats) -> Floats:
    """(2, 3) of x = A (1, y) from that of y = B (1, x), both pairs."""
    inverse = np.linalg.inv(matrix[:, 1:])
    return np.column_stack([-inverse @ matrix[:, 0], inverse])


#: (drop, k_S) = SPRING_OF_SOIL (1, phi, sigma_1).
SPRING_OF_SOIL = _inverse(SPRING)
#: Stiffness (N/m) at which both intercepts of table V are the same; the linear relation assumes it.
ASSUMED_SPRING = (1.434 - 0.882) / 0.789 * STIFFNESS


def affine(rows: Floats, x: Real, y: Real) -> tuple[Floats, Floats]:
    """Two numbers by c + p x + q y, of rows (c, p, q), such as `SPRING`, its inverse or a line."""
    first, second = (c + p * np.asarray(x) + q * np.asarray(y) for c, p, q in rows)
    return first, second


def _of_spring(intercept: float, by_stiffness: float) -> Floats:
    """(2, 3) of intercept and slope by the soil: table V, with the stiffness in kN/m.

    It prints rad^-1 of the drop of friction: in radians the drop would have no effect on the slip.
    """
    by_spring = np.asarray(
        [[0.022 * DEGREE, by_stiffness / STIFFNESS], [-0.156 * DEGREE / GRAVITY, 0.0]]
    )
    found = by_spring @ SPRING_OF_SOIL
    found[:, 0] += [intercept, 6.609 / GRAVITY]
    return np.asarray(found)


#: Intercept of the simplified relation, which all soils share (eq. 19).
INTERCEPT = -0.33
#: Reading of the torque at midstance, N m: i = INTERCEPT + y x, phi = 1 - 0.58 y and
#: sigma_1 = -0.7 + 20.928 y + 15.997 INTERCEPT in N/cm^2 (table IV, empirical and simplified).
TORQUE = StrideRelation(
    at_none=(INTERCEPT, 0.0),
    rate=(0.0, 1.0),
    of_soil=np.asarray([[INTERCEPT, 0.0, 0.0], [1.0 / 0.58, -1.0 / 0.58, 0.0]]),
    to_soil=np.asarray([[1.0, -0.58], [PRESSURE * (-0.7 + 15.997 * INTERCEPT), PRESSURE * 20.928]]),
    slip_std=0.018**0.5,
    errors=TORQUE_ERRORS,
)
#: Reading of the vibration after midstance, m/s^2, with y the drop of friction (table V, linear).
VIBRATION = StrideRelation(
    at_none=(-0.882, 6.609 / GRAVITY),
    rate=(0.022 * DEGREE, -0.156 * DEGREE / GRAVITY),
    of_soil=_of_spring(-0.882, 0.0),
    to_soil=np.column_stack([SPRING[:, 0] + SPRING[:, 2] * ASSUMED_SPRING, SPRING[:, 1]]),
    slip_std=0.020**0.5,
    errors=VIBRATION_ERRORS,
)


def _of_fit(friction: list[float], stiffness: list[float]) -> Floats:
    """(2, 3) of (a, b) by the soil: table IV has phi and sigma_1 (N/cm^2) by (1, a, b)."""
    return _inverse(np.asarray([friction, [PRESSURE * c for c in stiffness]]))


TORQUE_SLIP: dict[str, SlipLine] = {
    "terramechanics": SlipLine(
        of_soil=_of_fit([0.661, -0.377, -0.466], [-0.356, 0.0, 1.434]), slip_std=0.074**0.5
    ),
    "empirical": SlipLine(
        of_soil=_of_fit([1.0, 0.0, -0.58], [-0.7, 15.997, 20.928]), slip_std=0.005**0.5
    ),
    "simplified": TORQUE,
}
VIBRATION_SLIP: dict[str, SlipLine] = {
    "planar": SlipLine(of_soil=_of_spring(-1.434, 0.789), slip_std=0.015**0.5),
    "linear": VIBRATION,
}
#: sigma_1 = s_sigma / z and phi = s_I + s_Z z by the midstance sinkage z (m): eq. 29, table VII.
S_SIGMA, S_I, S_Z = 339.0, 0.76, -7.0
#: Sinkages (m) that give friction angles between those of the four soils.
SINKAGE_RANGE = (0.002, 0.036)


def soil_of_sinkage(sinkage: Real) -> LegSoil:
    """The soil by the mean of midstance sinkages (m); raises `InputError` for one not above 0.

    References: Comin and Saaj 2017, eq. 29, whose two relations are not consistent on all soils.
    """
    if np.any(~(np.asarray(sinkage, float) > 0.0)):
        raise InputError("a midstance sinkage must be above 0 m")
    z = float(np.mean(sinkage))
    return LegSoil(np.asarray([S_I + S_Z * z, S_SIGMA / z]), np.zeros((2, 2)), SINKAGE_ERRORS)
