"""Directions in which readings can deviate: signatures of effects, and smooth functions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.errors import InputError
from soilml.fitting.coordinates import Coordinate, size_coordinate
from soilml.fitting.levels import Levels, covariate_levels
from soilml.fitting.predictions import PredictionRequest, linearise, predict_many
from soilml.fitting.readings import Readings
from soilml.gap.candidate_effects import gears_differ, with_effect
from soilml.physics.effects.base import Effect
from soilml.physics.operating_point import COVARIATES, FROM_ORDER
from soilml.remarks import Remark

#: Step of the secant that gives a signature, in reference sizes. A secant is used because some
#: effects start with a square root, whose derivative at zero is infinite.
SECANT_STEP = 0.5
MIN_CHANGE = 1e-6  # A signature below this fraction of every reading's noise counts as zero


@dataclass(frozen=True)
class Signature:
    """Change of every reading, (m,), per reference size of an effect."""

    name: str
    kind: str
    column: Floats
    sign: int  # 1 or -1 where the size can only change in that direction, 0 where it can in both


def current_size(case: Case, path: str, unit: float) -> float:
    """Coordinate of an effect's size in the case, in reference sizes; 0 where it is absent."""
    parameters = case.parameters()
    return float(parameters[path][1]) / unit if path in parameters else 0.0


def effect_signatures(
    case: Case, readings: Readings, effects: Mapping[str, type[Effect]]
) -> tuple[list[Signature], dict[str, Remark]]:
    """Signatures of the effects that these runs can test, and why they cannot test the others.

    An effect that the case has already is changed from its present size, which may be wrong.
    """
    base = linearise(case, [], np.zeros(0), readings)
    sinkage = base.sinkage_at(np.zeros((1, 0)))
    requests = []
    reasons: dict[str, Remark] = {}
    changes: dict[str, tuple[Coordinate, float, float]] = {}
    for name, effect in effects.items():
        if reason := _missing_covariate(case, effect, readings):
            reasons[name] = reason
            continue
        size = size_coordinate(effect, None)
        try:
            changed = with_effect(case, effect)
            at = current_size(changed, size.path, size.reference_size)
            step = SECANT_STEP if size.upper >= at + SECANT_STEP else -SECANT_STEP
        except InputError as error:
            reasons[name] = Remark("refused", str(error), (name,))
            continue
        changes[name] = size, at, step
        x = np.asarray([[at + step]])
        requests.append(PredictionRequest(changed, [size], x, readings, sinkage))
    signatures = []
    predictions = predict_many(requests)
    for (name, (size, at, step)), prediction in zip(changes.items(), predictions, strict=True):
        if isinstance(prediction, InputError):
            reasons[name] = Remark("refused", str(prediction), (name,))
            continue
        column = (prediction[0] - base.prediction) / step
        if not np.isfinite(column).all():
            text = "with it, the model has no equilibrium in some row"
            reasons[name] = Remark("no-equilibrium", text, (name,))
        elif not np.any(np.abs(column) > MIN_CHANGE * readings.std):
            reasons[name] = Remark("no-change", "it changes no measured quantity", (name,))
        else:
            sign = 0 if size.lower < at < size.upper else int(np.sign(step))
            signatures.append(Signature(name, effects[name].about.kind, column, sign))
    return signatures, {name: reasons[name] for name in effects if name in reasons}


def _missing_covariate(case: Case, effect: type[Effect], readings: Readings) -> Remark | None:
    """What these runs lack to test an effect; None where they have it."""
    if effect.about.varied and not gears_differ(case, effect.about.varied_dimension):
        return Remark("unvaried-gear", f"needs {effect.about.varied}", (effect.name,))
    for field in (*effect.about.needs, *effect.about.uses):
        value = getattr(readings.at, field)
        if value is None:
            text = f"needs the column {COVARIATES[field]}"
            return Remark("missing-column", text, (effect.name,))
        values = np.broadcast_to(value, readings.run.shape)
        varies = bool(np.ptp(values) > 0.0)
        if field not in FROM_ORDER:
            varies = covariate_levels(field, values, readings.run).count > 1
        if not varies:
            text = f"needs runs at several values of {COVARIATES[field]}"
            return Remark("constant-column", text, (effect.name,))
    return None


#: Degrees in slip and in log load of the smooth functions: enough for one maximum and one
#: inflection over slip, and for a curvature over load.
SLIP_DEGREE, LOAD_DEGREE = 4, 2
#: Readings of a channel per smooth function, so that noise cannot be fitted.
READINGS_PER_FUNCTION = 4
#: Bins along slip and along load of the discrepancy map, and readings that a region needs.
SLIP_BINS, LOAD_BINS, MIN_READINGS = 4, 3, 2


def smooth_basis(readings: Readings) -> Floats:
    """Products of Legendre polynomials of slip and log load for each channel and gear, (m, q).

    Each column is in the unit of its channel's noise. The degree is limited by the number of
    levels of slip and load.
    """
    slip, load = _scaled(readings.slip), _scaled(np.log(readings.load))
    degrees = (
        min(SLIP_DEGREE, readings.slip_levels.count - 1),
        min(LOAD_DEGREE, readings.load_levels.count - 1),
    )
    columns = []
    for channel, gear in product(range(len(readings.channels)), np.unique(readings.gear)):
        in_channel = (readings.channel == channel) & (readings.gear == gear)
        most = int(in_channel.sum()) // READINGS_PER_FUNCTION
        for i, j in _orders(*degrees)[:most]:
            basis = np.polynomial.legendre.Legendre.basis(i)(slip)
            basis = basis * np.polynomial.legendre.Legendre.basis(j)(load)
            std = np.median(readings.std[in_channel])
            columns.append(np.where(in_channel, basis, 0.0) * std)
    return np.stack(columns, axis=1) if columns else np.zeros((len(readings), 0))


def _orders(slip: int, load: int) -> list[tuple[int, int]]:
    """Orders of the products up to the larger degree in total, the smoothest first."""
    pairs = [(i, j) for i in range(slip + 1) for j in range(load + 1) if i + j <= max(slip, load)]
    return sorted(pairs, key=lambda pair: (pair[0] + pair[1], pair[1]))


def _scaled(values: Floats) -> Floats:
    """Values mapped to -1 to 1, the interval on which Legendre polynomials are orthogonal."""
    low, high = float(values.min()), float(values.max())
    return 2.0 * (values - low) / (high - low) - 1.0 if high > low else np.zeros_like(values)


@dataclass(frozen=True)
class ReadingsRegion:
    """The readings of one channel between two slips and two loads (N)."""

    channel: str
    slip: tuple[float, float]
    load: tuple[float, float]
    selected: NDArray[np.bool_]  # (m,)


def regions(readings: Readings) -> Iterator[ReadingsRegion]:
    """Channel by slip bin by load bin, those with enough readings."""
    slips = _bins(readings.slip, readings.slip_levels, SLIP_BINS)
    loads = _bins(readings.load, readings.load_levels, LOAD_BINS)
    for i, name in enumerate(readings.channels):
        for low, high in slips:
            for light, heavy in loads:
                selected = (readings.channel == i) & (readings.slip >= low)
                selected &= (readings.slip <= high) & (readings.load >= light)
                selected &= readings.load <= heavy
                if selected.sum() >= MIN_READINGS:
                    yield ReadingsRegion(name, (low, high), (light, heavy), selected)


def _bins(values: Floats, levels: Levels, count: int) -> list[tuple[float, float]]:
    """Bins with nearly equal numbers of levels, from the lowest to the highest value of each."""
    parts = np.array_split(np.arange(levels.count), min(count, levels.count))
    own = [values[np.isin(levels.index, part)] for part in parts]
    return [(float(part.min()), float(part.max())) for part in own]
