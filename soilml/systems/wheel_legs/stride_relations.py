"""Linear relations of a wheel-leg's torque, vibration and sinkage to slip and soil, as printed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

import numpy as np

from soilml.arrays import Floats
from soilml.errors import FitError, InputError

Real = float | Floats

#: 1 N/cm^2 in Pa, 1 kN/m in N/m, 1 g in m/s^2, 1 rad in degrees: units of printed coefficients.
PRESSURE, STIFFNESS, GRAVITY, DEGREE = 1e4, 1e3, 9.81, 180.0 / np.pi
MIN_RANGE = 1.0  # Smallest range of slips for a regression, in standard deviations of the slip
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

    def deviations(self, friction_angle: float, normal_stiffness: float) -> Floats:
        """Errors about these estimates, rad and Pa (2, soils), scaled to unit variance."""
        shares = np.asarray([self.friction, self.stiffness]) * 0.01
        return np.asarray(shares * [[friction_angle], [normal_stiffness]] / 2.0)


#: By relation. The table has no row for torque by "terramechanics", for which EMPIRICAL stands.
EMPIRICAL = SoilErrors((-1, 4, 27, 28), (29, -2, -134, 28), (14.0, 49.0))
SIMPLIFIED = SoilErrors((-7, -9, 21, 4), (36, -6, -92, -11), (14.0, 54.0))
PLANAR = SoilErrors((6, -5, 20, 18), (59, -25, -36, -46), (9.0, 24.0))
LINEAR = SoilErrors((1, 3, 5, 23), (-27, -50, -4, -78), (14.0, 27.0))
SINKAGE = SoilErrors((-17, -8, 4, 2), (30, 24, -5, -17), (9.0, 24.0))


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
        """The errors that all strides on a soil share, (2, soils), of unit variance."""
        return self.errors.deviations(float(self.mean[0]), float(self.mean[1]))

    @property
    def covariance(self) -> Floats:
        """Covariance (2, 2); too small for another wheel-leg."""
        return np.asarray(self.of_strides + self.deviations @ self.deviations.T)

    @property
    def std(self) -> Floats:
        """Standard deviations of friction angle (rad) and normal stiffness (Pa)."""
        return np.sqrt(np.diag(self.covariance))


@final
@dataclass(frozen=True, kw_only=True)
class SlipRelation:
    r"""Slip from a reading x of a stride, i = a + b x, with the soil in a and b (SI units).

    of_soil (2, 3): (a, b) = of_soil (1, phi, sigma_1).
    to_soil (2, 1 + k): (phi, sigma_1) = to_soil (1, y); y is (a, b) of a regression of slip on x,
    or the one unknown of a relation that a single stride determines.
    single: (p, q, r, s) of such a relation, i = p + q x + y (r + s x); None for a regression.
    slip_std: Standard error of the slip.

    References: Comin and Saaj 2017, eqs. 18, 19, 24, 25, 27 and 28, tables IV to VIII. Valid for a
    five-legged wheel-leg with Load Testing Feet under a similar load, at slips of 0 to 0.5.
    """

    of_soil: Floats
    to_soil: Floats
    single: tuple[float, float, float, float] | None
    slip_std: float
    errors: SoilErrors

    def line(self, friction_angle: Real, normal_stiffness: Real) -> tuple[Floats, Floats]:
        """Intercept a and slope b on a soil of this angle (rad) and stiffness (Pa)."""
        a, b = (c + p * np.asarray(friction_angle) + q * np.asarray(normal_stiffness)
                for c, p, q in self.of_soil)  # fmt: skip
        return a, b

    def soil(self, reading: Real, slip: Real) -> LegSoil:
        """Estimate the soil from readings (SI) and slips, one pair (n,) for each stride.

        A relation with `single` needs one pair, the others two or more with different slips.

        Raises `InputError` for pairs that are not valid, `FitError` if they do not determine the
        soil or the estimate is not physical.

        Examples
        --------
        >>> found = TORQUE_SLIP["simplified"].soil(1.1, 0.25)
        >>> [round(float(np.rad2deg(v))) for v in (found.mean[0], found.std[0])]  # degrees
        [40, 6]
        """
        x, i = _pairs(reading, slip)
        if self.single is None:
            value, covariance = self._regressed(x, i)
        else:
            p, q, r, s = self.single
            rate = r + s * x
            if np.any(rate == 0.0):
                raise FitError("a reading of zero does not determine the soil; leave that pair out")
            each = (i - p - q * x) / rate
            information = (rate / self.slip_std) ** 2
            value = np.asarray([(each * information).sum() / information.sum()])
            covariance = np.asarray([[1.0 / information.sum()]])
        jacobian = self.to_soil[:, 1:]
        mean = self.to_soil[:, 0] + jacobian @ value
        of_strides = jacobian @ covariance @ jacobian.T
        margin = MAX_EXCESS * np.sqrt(np.diag(of_strides))
        if not -margin[0] <= mean[0] <= 0.5 * np.pi + margin[0] or mean[1] < -margin[1]:
            raise FitError(
                f"these pairs give a friction angle of {mean[0]:.3g} rad and a stiffness of "
                f"{mean[1]:.3g} Pa, which is not physical: the model is not valid for them"
            )
        return LegSoil(mean, of_strides, self.errors)

    def _regressed(self, x: Floats, i: Floats) -> tuple[Floats, Floats]:
        """Intercept and slope of slip on readings, and their covariance."""
        needed = MIN_RANGE * self.slip_std
        if x.size < 2 or np.ptp(i) < needed or np.ptp(x) == 0.0:
            raise FitError(
                f"{x.size} pairs with slips of a range of {np.ptp(i):.3g}; this model needs two or "
                f"more and {needed:.2g}, the error of its slip; the simplified (torque) and the "
                "linear (vibration) models need one pair"
            )
        design = np.column_stack([np.ones_like(x), x])
        line, *_ = np.linalg.lstsq(design, i, rcond=None)
        return np.asarray(line), self.slip_std**2 * np.linalg.inv(design.T @ design)


def _pairs(reading: Real, slip: Real) -> tuple[Floats, Floats]:
    x, i = (np.atleast_1d(np.asarray(v, float)) for v in (reading, slip))
    if x.ndim != 1 or x.shape != i.shape or x.size == 0:
        raise InputError(f"{x.size} readings and {i.size} slips are given; needed are pairs")
    if not (np.isfinite(x).all() and np.isfinite(i).all()):
        raise InputError("a reading or a slip is not a number; leave that pair out")
    if np.abs(i).max() > 1.0:
        raise InputError(
            f"slip is {i[np.abs(i).argmax()]:g}; it must lie between -1 and 1 (a fraction, not "
            "percent)"
        )
    return x, i


def affine_inverse(matrix: Floats) -> Floats:
    """(2, 3) of x = A (1, y) from that of y = B (1, x), both pairs."""
    inverse = np.linalg.inv(matrix[:, 1:])
    return np.column_stack([-inverse @ matrix[:, 0], inverse])


def _after(outer: Floats, inner: Floats) -> Floats:
    """The affine map `outer` (2, 3) of what the affine map `inner` (2, 1 + k) gives."""
    found = outer[:, 1:] @ inner
    found[:, 0] += outer[:, 0]
    return np.asarray(found)


#: (phi, sigma_1) = SPRING (1, drop of friction in rad, k_S in N/m), eq. 28 and table VII. t_K is
#: printed in cm^-1 and t_tau in N/cm^2/rad; the drop is in degrees for the angle. Only with these
#: units do all four soils have a spring (0.78 to 0.96 kN/m, 33 to 40 degrees) whose slip lies
#: between 0 and 0.5 for vibrations of some tenths of g.
SPRING = np.asarray(
    [[-0.76, 0.03 * DEGREE, 0.35 / STIFFNESS], [-0.2e4, 13.45e4, -0.81 * PRESSURE / 100.0]]
)


def spring_soil(increment: Real, stiffness: Real) -> tuple[Floats, Floats]:
    """(friction angle in rad, sigma_1 in Pa) from drop of friction (rad) and k_S (N/m), eq. 28."""
    angle, sigma = (c + p * np.asarray(increment) + q * np.asarray(stiffness) for c, p, q in SPRING)
    return angle, sigma


def soil_spring(friction_angle: Real, normal_stiffness: Real) -> tuple[Floats, Floats]:
    """(drop of friction in rad, k_S in N/m) of a soil: the exact inverse of `spring_soil`."""
    rows = affine_inverse(SPRING)
    drop, k = (c + p * np.asarray(friction_angle) + q * np.asarray(normal_stiffness)
               for c, p, q in rows)  # fmt: skip
    return drop, k


def _torque(
    friction: tuple[float, float, float],
    stiffness: tuple[float, float, float],
    variance: float,
    errors: SoilErrors,
    intercept: float | None = None,
) -> SlipRelation:
    """From (c, b, a) of phi = c + b slope + a intercept, and of sigma_1 in N/cm^2."""
    c, b, a = np.transpose([friction, stiffness]) * [1.0, PRESSURE]
    both = np.column_stack([c, a, b])
    if intercept is None:
        of_soil, to_soil, single = affine_inverse(both), both, None
    else:
        of_soil = np.asarray([[intercept, 0.0, 0.0], [-c[0] / b[0], 1.0 / b[0], 0.0]])
        to_soil, single = np.column_stack([c + a * intercept, b]), (intercept, 0.0, 0.0, 1.0)
    return SlipRelation(
        of_soil=of_soil, to_soil=to_soil, single=single, slip_std=variance**0.5, errors=errors
    )


def _vibration(
    c_i: float, c_k: float, variance: float, errors: SoilErrors, assumed: float | None = None
) -> SlipRelation:
    """From a = c_I + c_mu drop + c_K k_S and b = a_mu + b_mu drop; k_S `assumed` where c_K = 0."""
    c_mu, a_mu, b_mu = 0.022 * DEGREE, 6.609 / GRAVITY, -0.156 * DEGREE / GRAVITY
    by_spring = np.asarray([[c_i, c_mu, c_k / STIFFNESS], [a_mu, b_mu, 0.0]])
    of_soil, single = _after(by_spring, affine_inverse(SPRING)), None
    if assumed is None:
        to_soil = _after(SPRING, affine_inverse(by_spring))
    else:
        single = (c_i, a_mu, c_mu, b_mu)
        to_soil = np.column_stack([SPRING[:, 0] + SPRING[:, 2] * assumed, SPRING[:, 1]])
    return SlipRelation(
        of_soil=of_soil, to_soil=to_soil, single=single, slip_std=variance**0.5, errors=errors
    )


_SHEAR, _NORMAL = (1.0, -0.58, 0.0), (-0.7, 20.928, 15.997)
#: Readings of the torque at midstance, N m. Table IV, with the variances of slip of table VI.
TORQUE_SLIP: dict[str, SlipRelation] = {
    "terramechanics": _torque((0.661, -0.466, -0.377), (-0.356, 1.434, 0.0), 0.074, EMPIRICAL),
    "empirical": _torque(_SHEAR, _NORMAL, 0.005, EMPIRICAL),
    "simplified": _torque(_SHEAR, _NORMAL, 0.018, SIMPLIFIED, intercept=-0.33),
}
#: Stiffness (N/m) at which both intercepts of table V are the same.
ASSUMED_SPRING = (1.434 - 0.882) / 0.789 * STIFFNESS
#: Readings of the vibration after midstance, m/s^2. Table V, which prints rad^-1: in radians the
#: drop of friction would have no effect on the slip.
VIBRATION_SLIP: dict[str, SlipRelation] = {
    "planar": _vibration(-1.434, 0.789, 0.015, PLANAR),
    "linear": _vibration(-0.882, 0.0, 0.020, LINEAR, assumed=ASSUMED_SPRING),
}


def find_relation(name: str, catalogue: Mapping[str, SlipRelation]) -> SlipRelation:
    """The relation of this name; raises `InputError` for an unknown one."""
    if name not in catalogue:
        raise InputError(f"no slip model {name!r}; there are: {', '.join(catalogue)}")
    return catalogue[name]


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
    return LegSoil(np.asarray([S_I + S_Z * z, S_SIGMA / z]), np.zeros((2, 2)), SINKAGE)
