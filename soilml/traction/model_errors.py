"""Draws of the error of the model, which is smooth in slip and load, given what a soil leaves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.config.measurement_noise import range_with_zero
from soilml.config.remainder import Remainder
from soilml.fitting.covariance import USUAL
from soilml.fitting.predictions import forces
from soilml.fitting.readings import Readings
from soilml.numerics.smooth_process import SmoothFunctions, process_columns, slip_load_points
from soilml.quantities import column
from soilml.traction.draws import DrawnErrors

#: Correlation lengths outside the range of the readings within which the drawn error fades. Of 1
#: and 2, 1 scored better under lighter loads and beyond the slips, seeds 1 and 2.
FADING_LENGTH = 1.0

Key = tuple[str, str]  # Channel and gear; the gear of a case with one is ""


@dataclass(frozen=True, eq=False)
class LeftByDraws:
    """What some draws of the soil leave of the m readings, and how large the model's error is.

    place: Numbers (k,) of these draws among all.
    sizes: By channel, the error's standard deviation in the range of the readings and far beyond.
    residual: Readings less predictions (k, m); None where the readings are to tell nothing.
    whiten: What makes the covariance of their noise one, by `@`, (m, m).
    """

    place: NDArray[np.int64]
    sizes: Mapping[str, tuple[float, float]]
    residual: Floats | None = None
    whiten: Any = None


def drawn_errors(
    case: Case,
    readings: Readings,
    left: Sequence[LeftByDraws],
    slip: Floats,
    load: Sequence[float],
    channels: Sequence[str],
    spread: float = 1.0,
) -> tuple[DrawnErrors, DrawnErrors] | None:
    r"""Errors given the readings, and before them, in these ranges; None where no channel has one.

    Within the range of the readings an error is a process C w of standard normal weights w. What a
    draw leaves of the readings, r with whitening L, gives

    .. math:: E[w] = M^{-1} B^T L r, \quad \operatorname{cov}[w] = M^{-1}, \quad
        M = I + B^T B, \quad B = L C

    Beyond the range it fades to one of zero mean and of a usual error at least:

    .. math:: \delta(x) = q\,\delta(x') + \sqrt{1 - q^2}\; b\,\xi(x), \quad
        q = e^{-d^2 / (2 \lambda^2)}

    with the nearest point x' of the range, at the distance d in correlation lengths. A [remainder]
    has functions of its own, about its mean, which is in the predictions.

    slip, load: Slips and loads (N) at which errors are asked for.
    spread: Factor on the standard deviations that the readings leave.

    References: Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, eqs. 2.7 and
    2.8.
    """
    rng = np.random.default_rng(0)
    asked = _ends(np.append(readings.slip, slip)), _ends(np.append(readings.load, load))
    functions = {
        (name, gear): _Fading.of(case, readings, gear, name, *asked)
        for name in dict.fromkeys([*channels, *readings.channels])  # all share the rows
        if any(name in part.sizes for part in left)
        for gear in case.gears or [""]
        if (own := learned(case, name)) is None or own.of(name, gear)
    }
    joined = {key: own.joined for key, own in functions.items() if key[0] in channels}
    if not joined:
        return None
    count = sum(len(part.place) for part in left)
    after = {key: np.zeros((count, functions[key].count)) for key in joined}
    before = {key: np.zeros_like(own) for key, own in after.items()}
    for part in left:
        k = len(part.place)
        normal = {key: rng.standard_normal((k, f.inside.count)) for key, f in functions.items()}
        given = _given(part, readings, functions, normal, spread)
        for key in joined:
            inside, beyond = part.sizes[key[0]]
            outside = beyond * rng.standard_normal((k, functions[key].beyond.count))
            after[key][part.place] = np.concatenate([inside * given[key], outside], axis=1)
            before[key][part.place] = np.concatenate([inside * normal[key], outside], axis=1)
    return DrawnErrors(joined, after, *asked), DrawnErrors(joined, before, *asked)


def _given(
    part: LeftByDraws,
    readings: Readings,
    functions: Mapping[Key, _Fading],
    normal: Mapping[Key, Floats],
    spread: float,
) -> dict[Key, Floats]:
    """Weights (k, q) of unit functions given what the draws leave of the readings."""
    given, columns = dict(normal), dict[Key, Floats]()
    for (channel, gear), own in functions.items():
        size, _ = part.sizes[channel]
        if part.residual is None or channel not in readings.channels or size == 0.0:
            continue
        of = readings.channel == readings.channels.index(channel)
        of &= _of_gear(readings, gear)
        columns[channel, gear] = np.zeros((len(readings), own.inside.count))
        columns[channel, gear][of] = size * own.inside.at(readings.slip[of], readings.load[of])
    if not columns or part.residual is None:
        return given
    white = np.asarray(part.whiten @ np.concatenate(list(columns.values()), axis=1))
    factor = np.linalg.cholesky(np.eye(white.shape[1]) + white.T @ white)
    half = np.linalg.solve(factor, white.T @ np.asarray(part.whiten @ part.residual.T))
    z = spread * np.concatenate([normal[key] for key in columns], axis=1).T
    weights = np.linalg.solve(factor.T, half + z).T
    ends = np.cumsum([own.shape[1] for own in columns.values()])
    return given | dict(zip(columns, np.split(weights, ends[:-1], axis=1), strict=True))


@dataclass(frozen=True)
class _Fading:
    """Unit functions of one channel of one gear: those of the range, and those beyond it."""

    inside: SmoothFunctions
    beyond: SmoothFunctions

    @property
    def count(self) -> int:
        return self.inside.count + self.beyond.count

    @property
    def joined(self) -> SmoothFunctions:
        return SmoothFunctions.joined([self.inside, self.beyond])

    @staticmethod
    def of(
        case: Case,
        readings: Readings,
        gear: str,
        channel: str,
        slip: tuple[float, float],
        load: tuple[float, float],
    ) -> _Fading:
        if (own := learned(case, channel)) is not None:
            return _Fading(own.error_functions(channel, slip, load, gear), SmoothFunctions(()))
        declared = case.discrepancy.get(column(channel), USUAL)
        lengths = declared.slip_length, declared.log_load_length
        driven = _of_gear(readings, gear)
        ends = _ends(readings.slip[driven]), _ends(readings.load[driven])

        def scaled(slip: Floats, load: Floats) -> tuple[Floats, Floats]:
            at = slip_load_points(slip, load, *lengths)
            near = slip_load_points(np.clip(slip, *ends[0]), np.clip(load, *ends[1]), *lengths)
            apart = ((at - near) ** 2).sum(axis=1)
            return near, np.exp(-0.5 * apart / FADING_LENGTH**2)

        def inside(slip: Floats, load: Floats) -> Floats:
            near, share = scaled(slip, load)
            return np.asarray(share[:, None] * process_columns(near))

        def unit(slip: Floats, load: Floats) -> Floats:
            return process_columns(slip_load_points(slip, load, *lengths))

        def lost(slip: Floats, load: Floats) -> Floats:
            return np.asarray(np.sqrt(np.maximum(1.0 - scaled(slip, load)[1] ** 2, 0.0)))

        beyond = SmoothFunctions.of(unit, lengths, slip, load).times(lost)
        return _Fading(SmoothFunctions.of(inside, lengths, slip, load), beyond)


def learned(case: Case, channel: str) -> Remainder | None:
    """The [remainder] of a case where it has the channel."""
    own = case.remainder
    return own if own is not None and column(channel) in own.columns else None


def stated_size(case: Case, readings: Readings, channel: str) -> float:
    """Standard deviation of the error that [discrepancy] states for a channel; 0 without one."""
    stated = case.discrepancy.get(column(channel))
    return 0.0 if stated is None else stated.amplitude(span(case, readings, channel))


def span(case: Case, readings: Readings, channel: str) -> float:
    """Range of a channel's readings, or, where it was not measured, of its predictions there."""
    if channel in readings.channels:
        own = readings.channel == readings.channels.index(channel)
        return range_with_zero(readings.measured[own])
    return range_with_zero(np.asarray(getattr(forces(case, readings.at), channel)))


def _of_gear(readings: Readings, gear: str) -> NDArray[np.bool_]:
    """Which readings (m,) are of a gear; all where there is one."""
    if not gear or readings.at.gear is None:
        return np.ones(len(readings), bool)
    driven = np.broadcast_to(np.asarray(readings.at.gear), len(readings.run))
    return np.asarray(driven[readings.row] == gear)


def _ends(values: Floats) -> tuple[float, float]:
    return float(np.min(values)), float(np.max(values))
