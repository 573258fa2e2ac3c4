"""Strides of a wheel-leg: the soil by each sensor and fused, what it means, and the slip."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from soilml.arrays import Floats
from soilml.errors import FitError, InputError
from soilml.onboard.fusion_rules import inverse_variance, pairwise
from soilml.physics.gears import Wheel
from soilml.physics.model import Model
from soilml.physics.operating_point import Operating
from soilml.physics.pull_efficiency import CLASSES, pull_efficiency, traffic_class
from soilml.physics.soils import Soil
from soilml.quantities import Z_90
from soilml.remarks import Remark
from soilml.report.column_figure import ParameterIntervals
from soilml.report.numbers import format_quantity
from soilml.report.report import Picture, Report, by_group
from soilml.report.tables import ReportTable
from soilml.systems.wheel_legs.stride_relations import (
    GRAVITY,
    SINKAGE_RANGE,
    TORQUE,
    VIBRATION,
    LegSoil,
    soil_of_sinkage,
)

LOWEST, HIGHEST = 0.0, 0.5  # Slips of the tests that the relations come from
#: The heavy rover of section V-C: 300 kg on six wheels of 15 cm radius. Width and slip are not
#: printed; with these the order of the four soils and about their efficiencies come out.
HEAVY_WHEEL, HEAVY_AT = Wheel(radius=0.15, width=0.18), Operating(slip=0.2, load=50.0 * GRAVITY)
#: What strides do not show of the soil, as ranges over the four of table I: exponent of sinkage,
#: cohesion (Pa) and shear modulus (m); draws of these and of the fused soil.
UNKNOWN = {"n": (0.45, 0.95), "cohesion": (0.0, 1610.0), "shear_modulus": (0.0017, 0.0024)}
DRAWS = 400
#: The soil by readings and slips (n,) of strides, by sensor.
BY_SENSOR: dict[str, Callable[[Floats, Floats], LegSoil]] = {
    "torque": TORQUE.soil,
    "vibration": VIBRATION.soil,
    "sinkage": lambda sinkage, _: soil_of_sinkage(sinkage),
}


@dataclass(frozen=True)
class StrideSoil:
    """Friction angle (rad) and normal stiffness (Pa) of one soil by each sensor, and fused.

    mean, std (sensors, 2): Angle and stiffness, in the order of `sensors`; "fused" is last where
    there are several.
    covariance (2, 2): Of the last.
    strides (sensors,): How many rows each sensor has.
    remarks: Sensors without an estimate, and a mean sinkage outside of the range of its relation.
    """

    sensors: tuple[str, ...]
    mean: Floats
    std: Floats
    covariance: Floats
    strides: tuple[int, ...]
    remarks: tuple[Remark, ...]


def soil_of_strides(slip: Floats, readings: Mapping[str, Floats]) -> StrideSoil:
    """Estimate one soil from slip and torque, vibration and sinkage at midstance.

    Fused with the weights of the paper, which follow from the scatter of its table VIII. The errors
    that all strides on a soil share are correlated between sensors as those of the table are.

    Parameters
    ----------
    slip
        Slip of each stride (n,).
    readings
        `torque` (N m), `vibration` (m/s^2) and `sinkage` (m) of each stride (n,), one or more of
        them; NaN where not measured.

    Raises
    ------
    InputError
        For readings that are not valid, and where nothing was measured.
    FitError
        Where no sensor gives an estimate, with the reasons.

    References
    ----------
    Comin and Saaj 2017, eqs. 27 to 30, tables IV, V and VII.

    Examples
    --------
    >>> found = soil_of_strides([0.25], {"torque": [1.1], "sinkage": [0.012]})
    >>> found.sensors, np.rad2deg(found.mean[:, 0]).round().tolist()
    (('torque', 'sinkage', 'fused'), [40.0, 39.0, 39.0])
    """
    slip = np.atleast_1d(np.asarray(slip, float))
    found: dict[str, LegSoil] = {}
    strides: list[int] = []
    unused: list[Remark] = []
    for sensor in (name for name in BY_SENSOR if name in readings):
        value = np.atleast_1d(np.asarray(readings[sensor], float))
        if value.shape != slip.shape:
            raise InputError(
                f"{value.size} values of {sensor} and {slip.size} slips; needed are pairs"
            )
        read = np.isfinite(value)
        if not read.any():
            continue
        try:
            found[sensor] = BY_SENSOR[sensor](value[read], slip[read])
        except FitError as error:
            unused.append(Remark("unused", f"no estimate from {sensor}: {error}", (sensor,)))
            continue
        strides.append(int(read.sum()))
        low, high = SINKAGE_RANGE
        if sensor == "sinkage" and not low <= value[read].mean() <= high:
            text = f"the mean sinkage is outside of the {1e3 * low:.0f} to {1e3 * high:.0f} mm "
            unused.append(Remark("outside-range", f"{text}of its relation", (sensor,)))
    if not found and not unused:
        raise InputError("nothing was measured: give torque, vibration or sinkage of each stride")
    if not found:
        raise FitError("; ".join(remark.text for remark in unused))
    each, sensors = list(found.values()), tuple(found)
    mean = np.stack([one.mean for one in each])
    weights = np.ones((1, 2))
    if len(each) > 1:
        weights = pairwise(mean, np.asarray([one.errors.scatter for one in each])).weights
        mean = np.vstack([mean, (weights * mean).sum(axis=0)])
        sensors, strides = (*sensors, "fused"), [*strides, max(strides)]
    pairs = list(zip(weights, each, strict=True))
    shared = np.sum([w[:, None] * one.deviations for w, one in pairs], axis=0)
    of_strides = np.sum([np.outer(w, w) * one.of_strides for w, one in pairs], axis=0)
    covariance = shared @ shared.T + of_strides
    std = np.stack([*(one.std for one in each), np.sqrt(np.diag(covariance))])[: len(sensors)]
    return StrideSoil(sensors, mean, std, covariance, tuple(strides), tuple(unused))


@dataclass(frozen=True)
class Mobility:
    """What a soil means for a wheel of a heavy rover, by draws of what is not known of the soil.

    kphi: N/m^(n+2), median. efficiency: Pull efficiency, mean, and the ends of its 90 % interval.
    probability: Of each class of `CLASSES`.
    """

    kphi: float
    efficiency: float
    ends: tuple[float, float]
    probability: Mapping[str, float]

    @property
    def traffic_class(self) -> str:
        """The class of the mean efficiency, as the paper classifies."""
        return str(traffic_class(self.efficiency))


def mobility(
    soil: StrideSoil,
    *,
    known: Mapping[str, float] | None = None,
    seed: int = 0,
) -> Mobility:
    r"""Pull efficiency of a heavy wheel on the soil that strides were fused to, with its class.

    .. math:: k_\varphi = \sigma_1 / (1\,\mathrm{cm})^n, \quad \eta = 1 - F_R / F_T

    Strides show neither the exponent of sinkage nor cohesion nor shear modulus: `known` has those
    that are known (`n`, `cohesion` in Pa, `shear_modulus` in m), the others are uniform over the
    ranges of the paper's four soils. A soil that does not carry the wheel is of the first class.
    Valid where the model of the rigid wheel is. References: Comin and Saaj 2017, eq. 32, table X.

    Raises `InputError` for an unknown name.

    Examples
    --------
    >>> found = mobility(soil_of_strides([0.25], {"torque": [1.1], "sinkage": [0.012]}))
    >>> found.traffic_class, round(found.efficiency, 1)
    ('trafficable', 0.7)
    """
    known = dict(known or {})
    if unknown := sorted(known.keys() - UNKNOWN.keys()):
        raise InputError(f"no soil parameter {unknown[0]!r}; there are: {', '.join(UNKNOWN)}")
    rng = np.random.default_rng(seed)
    drawn = rng.multivariate_normal(soil.mean[-1], soil.covariance, DRAWS)
    angle, sigma = np.clip(drawn[:, 0], 0.05, 1.2), np.maximum(drawn[:, 1], 100.0)
    others = {name: rng.uniform(*ends, DRAWS) for name, ends in UNKNOWN.items()}
    others |= {name: np.full(DRAWS, value) for name, value in known.items()}
    kphi = sigma / 0.01 ** others["n"]
    ground = Soil(friction_angle=angle, kc=np.zeros(DRAWS), kphi=kphi, **others)
    efficiency = np.asarray(pull_efficiency(Model(HEAVY_WHEEL), ground, HEAVY_AT))
    classes = traffic_class(efficiency)
    carried = np.nan_to_num(efficiency, nan=-1.0)
    return Mobility(
        kphi=float(np.median(kphi)),
        efficiency=float(np.nanmean(efficiency)) if np.isfinite(efficiency).any() else -1.0,
        ends=(float(np.quantile(carried, 0.05)), float(np.quantile(carried, 0.95))),
        probability={name: float(np.mean(classes == name)) for name in CLASSES},
    )


def stride_columns(soil: StrideSoil, means: Mobility) -> dict[str, list[Any]]:
    """A row for each sensor by names of columns; the last one has what the soil means."""
    before = len(soil.sensors) - 1
    likely = means.traffic_class
    of_last: dict[str, Any] = {
        "kphi_SI": means.kphi,
        "pull_efficiency": means.efficiency,
        "pull_efficiency_p05": means.ends[0],
        "pull_efficiency_p95": means.ends[1],
        "traffic_class": likely,
        "class_probability": means.probability[likely],
    }
    return {
        "sensor": list(soil.sensors),
        "friction_angle_rad": soil.mean[:, 0].tolist(),
        "friction_angle_rad_std": soil.std[:, 0].tolist(),
        "normal_stiffness_Pa": soil.mean[:, 1].tolist(),
        "normal_stiffness_Pa_std": soil.std[:, 1].tolist(),
        **{
            name: ["" if isinstance(value, str) else np.nan] * before + [value]
            for name, value in of_last.items()
        },
        "strides": list(soil.strides),
    }


def stride_report(
    found: Mapping[str, tuple[StrideSoil, Mobility]], failed: Mapping[str, str], by: str | None
) -> Report:
    """What strides say of one soil, or of soils by name; `failed` says why others have none."""
    reports = {name: _report_of_one(*own) for name, own in found.items()}
    if by is None:
        return next(iter(reports.values()))
    worst = min(found, key=lambda name: found[name][1].efficiency)
    verdict = f"The worst of {len(found)} soils is {worst}."
    whole = by_group(reports, failed, by, verdict, "Soil from strides")
    return replace(whole, pictures=[_picture({name: soil for name, (soil, _) in found.items()})])


def _report_of_one(soil: StrideSoil, means: Mobility) -> Report:
    angle = format_quantity(float(soil.mean[-1, 0]), "rad", float(soil.std[-1, 0]))
    efficiency = format_quantity(means.efficiency, "share", 0.0, means.ends)
    likely = means.traffic_class
    return Report(
        kind="wheel-leg",
        verdict=f"Friction angle {angle}; a heavy rover has a pull efficiency of {efficiency}: "
        f"{likely} ({means.probability[likely]:.0%}).",
        tables=[ReportTable.of("Soil by sensor", stride_columns(soil, means))],
        pictures=[_picture({"": soil})],
        remarks=soil.remarks,
        title="Soil from strides",
    )


def _picture(soils: Mapping[str, StrideSoil]) -> Picture:
    """Angle and stiffness by sensor of one soil, or of several by name."""
    labels = [f"{name}: {s}" if name else s for name, soil in soils.items() for s in soil.sensors]
    mean, std = (
        np.concatenate([getattr(soil, part) for soil in soils.values()]) for part in ("mean", "std")
    )
    blank = np.full(2, np.nan)
    return ParameterIntervals(
        ("friction_angle", "normal_stiffness"), ("rad", "Pa"), labels,
        mean, mean - Z_90 * std, mean + Z_90 * std, blank, blank,
    ).picture()  # fmt: skip


def slip_of_strides(
    readings: Mapping[str, Floats],
    friction_angle: float,
    normal_stiffness: float,
) -> dict[str, Floats]:
    """Slip by the printed relations on a soil of this angle (rad) and stiffness sigma_1 (Pa).

    readings: `torque` (N m) and `vibration` (m/s^2) of each stride (n,), or one of them; NaN where
        not measured.

    Returns: Columns (n,): slip_by_torque, slip_by_vibration and, fused by their variances, slip,
        with standard deviations; NaN where nothing was measured. `in_range` says whether the fused
        slip is one for which the relations were fitted.

    Raises `InputError` where nothing was measured. References: Comin and Saaj 2017, eqs. 19, 24, 26
    and 28, tables IV to VII, simplified and linear. The error of the relations is that of table VI,
    as for independent errors; on another soil or wheel-leg it is larger.

    Examples
    --------
    >>> found = slip_of_strides({"torque": [1.1], "vibration": [2.0]}, 0.6981, 11300.0)
    >>> names = ("slip_by_torque", "slip_by_vibration", "slip", "slip_std")
    >>> [round(float(found[name][0]), 2) for name in names]
    [0.24, 0.1, 0.17, 0.1]
    """
    columns: dict[str, Floats] = {}
    for name, relation in (("torque", TORQUE), ("vibration", VIBRATION)):
        if name in readings and np.isfinite(value := np.asarray(readings[name], float)).any():
            a, b = relation.line(friction_angle, normal_stiffness)
            columns[f"slip_by_{name}"] = np.asarray(a + b * value)
            std = np.where(np.isfinite(value), relation.slip_std, np.nan)
            columns[f"slip_by_{name}_std"] = std
    if not columns:
        raise InputError("nothing was measured: give torque or vibration of each stride")
    mean, each = (np.stack(list(columns.values())[k::2]) for k in range(2))
    read = np.isfinite(mean)
    with np.errstate(invalid="ignore"):  # a stride without a reading has no weight: NaN
        both = inverse_variance(np.where(read, mean, 0.0), np.where(read, each, np.inf))
    return columns | {
        "slip": both.mean,
        "slip_std": np.where(read.any(axis=0), both.std, np.nan),
        "in_range": (both.mean >= LOWEST) & (both.mean <= HIGHEST),
    }
