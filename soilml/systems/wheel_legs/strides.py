"""Strides of a wheel-leg: the soil by each sensor and fused, what it means, and the slip."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

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
from soilml.report.numbers import format_quantity
from soilml.report.parameter_figure import ParameterIntervals
from soilml.report.report import Report
from soilml.report.tables import ReportTable
from soilml.systems.wheel_legs.stride_relations import (
    GRAVITY,
    SINKAGE_RANGE,
    TORQUE_SLIP,
    VIBRATION_SLIP,
    LegSoil,
    find_relation,
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


@dataclass(frozen=True)
class StrideSoil:
    """Friction angle (rad) and normal stiffness (Pa) of one soil by each sensor, and fused.

    mean, std (sensors, 2): Angle and stiffness, in the order of `sensors`; "fused" is last where
    there are several.
    covariance (2, 2): Of the last.
    strides (sensors,): How many rows each sensor has.
    unused: Why a sensor that was read gives no estimate, by sensor.
    in_range: False where the mean sinkage is outside of the range of its relation.
    """

    sensors: tuple[str, ...]
    mean: Floats
    std: Floats
    covariance: Floats
    strides: tuple[int, ...]
    unused: Mapping[str, str]
    in_range: bool

    @property
    def remarks(self) -> list[Remark]:
        """Sensors without an estimate, and a sinkage outside of the range of its relation."""
        found = [
            Remark("unused", f"no estimate from {sensor}: {why}", (sensor,))
            for sensor, why in self.unused.items()
        ]
        if not self.in_range:
            low, high = (1e3 * end for end in SINKAGE_RANGE)
            text = f"the mean sinkage is outside of the {low:.0f} to {high:.0f} mm of its relation"
            found.append(Remark("outside-range", text, ("sinkage",)))
        return found


def soil_of_strides(
    slip: Floats,
    readings: Mapping[str, Floats],
    *,
    torque_model: str = "simplified",
    vibration_model: str = "linear",
) -> StrideSoil:
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
    torque_model, vibration_model
        Names in `TORQUE_SLIP` and `VIBRATION_SLIP`.

    Raises
    ------
    InputError
        For readings that are not valid, an unknown model, and where nothing was measured.
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
    torque = find_relation(torque_model, TORQUE_SLIP)
    vibration = find_relation(vibration_model, VIBRATION_SLIP)
    solve: dict[str, Callable[[Floats, Floats], LegSoil]] = {
        "torque": lambda value, at: torque.soil(value, at),
        "vibration": lambda value, at: vibration.soil(value, at),
        "sinkage": lambda value, _: soil_of_sinkage(value),
    }
    found: dict[str, LegSoil] = {}
    strides: list[int] = []
    unused: dict[str, str] = {}
    in_range = True
    for sensor in (name for name in solve if name in readings):
        value = np.atleast_1d(np.asarray(readings[sensor], float))
        if value.shape != slip.shape:
            raise InputError(
                f"{value.size} values of {sensor} and {slip.size} slips; needed are pairs"
            )
        read = np.isfinite(value)
        if not read.any():
            continue
        try:
            found[sensor] = solve[sensor](value[read], slip[read])
        except FitError as error:
            unused[sensor] = str(error)
            continue
        strides.append(int(read.sum()))
        if sensor == "sinkage":
            in_range = bool(SINKAGE_RANGE[0] <= value[read].mean() <= SINKAGE_RANGE[1])
    if not found and not unused:
        raise InputError("nothing was measured: give torque, vibration or sinkage of each stride")
    if not found:
        raise FitError("; ".join(f"{sensor}: {why}" for sensor, why in unused.items()))
    each, names = list(found.values()), tuple(found)
    mean, std = np.stack([one.mean for one in each]), np.stack([one.std for one in each])
    covariance = each[0].covariance
    if len(each) > 1:
        weights = pairwise(mean, np.asarray([one.errors.scatter for one in each])).weights
        mean = np.vstack([mean, (weights * mean).sum(axis=0)])
        shared = sum(w[:, None] * one.deviations for w, one in zip(weights, each, strict=True))
        covariance = shared @ shared.T + sum(
            np.outer(w, w) * one.of_strides for w, one in zip(weights, each, strict=True)
        )
        std = np.vstack([std, np.sqrt(np.diag(covariance))])
        names, strides = (*names, "fused"), [*strides, max(strides)]
    return StrideSoil(names, mean, std, covariance, tuple(strides), unused, in_range)


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
    wheel: Wheel = HEAVY_WHEEL,
    at: Operating = HEAVY_AT,
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
    efficiency = np.asarray(pull_efficiency(Model(wheel), ground, at))
    classes = traffic_class(efficiency)
    carried = np.nan_to_num(efficiency, nan=-1.0)
    return Mobility(
        kphi=float(np.median(kphi)),
        efficiency=float(np.nanmean(efficiency)) if np.isfinite(efficiency).any() else -1.0,
        ends=(float(np.quantile(carried, 0.05)), float(np.quantile(carried, 0.95))),
        probability={name: float(np.mean(classes == name)) for name in CLASSES},
    )


def stride_report(
    found: Mapping[str, tuple[StrideSoil, Mobility]], failed: Mapping[str, str], by: str | None
) -> tuple[Report, dict[str, Any]]:
    """What strides say of soils by name, and a row for each sensor by names of columns.

    failed: Why other groups have no soil. by: What tells the groups apart.
    """
    rows: dict[str, list[Any]] = {}
    lines, remarks = [], []
    for name, (soil, means) in found.items():
        head, last = f"{by} {name}: " if by else "", len(soil.sensors) - 1
        for k, sensor in enumerate(soil.sensors):
            own = means if k == last else None
            row: dict[str, Any] = {by: name} if by else {}
            row |= {"sensor": sensor}
            for i, column in enumerate(("friction_angle_rad", "normal_stiffness_Pa")):
                row |= {column: soil.mean[k, i], f"{column}_std": soil.std[k, i]}
            row |= {
                "kphi_SI": own.kphi if own else np.nan,
                "pull_efficiency": own.efficiency if own else np.nan,
                "pull_efficiency_p05": own.ends[0] if own else np.nan,
                "pull_efficiency_p95": own.ends[1] if own else np.nan,
                "traffic_class": own.traffic_class if own else "",
                "class_probability": own.probability[own.traffic_class] if own else np.nan,
                "strides": soil.strides[k],
            }
            for key, value in row.items():
                rows.setdefault(key, []).append(value)
        angle, efficiency = (
            format_quantity(float(soil.mean[-1, 0]), "rad", float(soil.std[-1, 0])),
            format_quantity(means.efficiency, "share", 0.0, means.ends),
        )
        lines.append(
            f"{head}friction angle {angle}; a heavy rover has a pull efficiency of {efficiency}: "
            f"{means.traffic_class} ({means.probability[means.traffic_class]:.0%})"
        )
        remarks += [remark.under(head) for remark in soil.remarks]
    remarks += [Remark("no-result", f"{by} {n} has no result: {why}") for n, why in failed.items()]
    labels = [f"{n}: {s}" if by else s for n, (soil, _) in found.items() for s in soil.sensors]
    value = np.concatenate([soil.mean for soil, _ in found.values()])
    std = np.concatenate([soil.std for soil, _ in found.values()])
    blank = np.full(2, np.nan)
    figure = ParameterIntervals(
        ("friction_angle", "normal_stiffness"), ("rad", "Pa"), labels,
        value, value - Z_90 * std, value + Z_90 * std, blank, blank,
    )  # fmt: skip
    worst = min((means.efficiency, name) for name, (_, means) in found.items())
    verdict = lines[0] if len(found) == 1 else f"The worst of {len(found)} soils is {worst[1]}"
    report = Report(
        kind="wheel-leg",
        verdict=f"{verdict[0].upper()}{verdict[1:]}.",
        lines=[f"{line}." for line in lines] if len(found) > 1 else [],
        tables=[ReportTable.of("Soil by sensor", rows)],
        pictures=[figure.picture()],
        remarks=remarks,
        title="Soil from strides",
    )
    return report, rows


@dataclass(frozen=True)
class StrideSlip:
    """Slip of strides (n,) by each sensor, and fused; NaN where nothing was measured.

    by_sensor, std: By `torque` and `vibration`, (n,) each.
    fused, fused_std: By the variances of both, (n,).
    in_range: Whether the fused slip is one for which the relations were fitted, (n,).
    """

    by_sensor: Mapping[str, Floats]
    std: Mapping[str, Floats]
    fused: Floats
    fused_std: Floats
    in_range: NDArray[np.bool_]


def slip_of_strides(
    readings: Mapping[str, Floats],
    friction_angle: float,
    normal_stiffness: float,
    *,
    torque_model: str = "simplified",
    vibration_model: str = "linear",
) -> StrideSlip:
    """Slip by the printed relations on a soil of this angle (rad) and stiffness sigma_1 (Pa).

    readings: `torque` (N m) and `vibration` (m/s^2) of each stride (n,), or one of them; NaN where
        not measured. Other arguments as in `soil_of_strides`.

    Raises `InputError` for an unknown model, invalid standard deviations, and where nothing was
    measured. References: Comin and Saaj 2017, eqs. 18, 24, 26 and 28, tables IV to VII. The error
    of the relations is that of table VI, as for independent errors; on another soil or wheel-leg it
    is larger.

    Examples
    --------
    >>> found = slip_of_strides({"torque": [1.1], "vibration": [2.0]}, 0.6981, 11300.0)
    >>> {name: value.round(2).tolist() for name, value in found.by_sensor.items()}
    {'torque': [0.24], 'vibration': [0.1]}
    >>> found.fused.round(2).tolist(), found.fused_std.round(2).tolist()
    ([0.17], [0.1])
    """
    relations = {
        "torque": find_relation(torque_model, TORQUE_SLIP),
        "vibration": find_relation(vibration_model, VIBRATION_SLIP),
    }
    found, std = {}, {}
    for name, relation in relations.items():
        if name in readings and np.isfinite(value := np.asarray(readings[name], float)).any():
            a, b = relation.line(friction_angle, normal_stiffness)
            found[name] = np.asarray(a + b * value)
            std[name] = np.where(np.isfinite(value), relation.slip_std, np.nan)
    if not found:
        raise InputError("nothing was measured: give torque or vibration of each stride")
    mean, each = (np.stack(list(values.values())) for values in (found, std))
    read = np.isfinite(mean)
    with np.errstate(invalid="ignore"):  # a stride without a reading has no weight: NaN
        both = inverse_variance(np.where(read, mean, 0.0), np.where(read, each, np.inf))
    inside = (both.mean >= LOWEST) & (both.mean <= HIGHEST)
    return StrideSlip(found, std, both.mean, np.where(read.any(axis=0), both.std, np.nan), inside)
