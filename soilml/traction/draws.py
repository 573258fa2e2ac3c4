"""Equally weighted draws of the soil, and of the model's error beside each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.config.measurement_noise import range_with_zero
from soilml.fitting.operating_points import operating_points, rows_by_gear
from soilml.fitting.predictions import forces_of_one_gear
from soilml.fitting.readings import declared_std
from soilml.io.table import Table
from soilml.numerics.smooth_functions import SmoothFunctions
from soilml.numerics.smooth_process import process_columns, slip_load_points
from soilml.physics.contact import Force
from soilml.physics.operating_point import Operating
from soilml.quantities import CHANNELS, column


@dataclass(frozen=True)
class DrawnErrors:
    """Errors of n draws, of each channel and gear that has one.

    functions: By channel and gear; the gear of a case with one is "".
    weights: Weights (n, q) of the functions.
    slip, load: Range of the errors; beyond it they are as at its end.
    """

    functions: Mapping[tuple[str, str], SmoothFunctions]
    weights: Mapping[tuple[str, str], Floats]
    slip: tuple[float, float]
    load: tuple[float, float]

    def at(
        self, channel: str, gear: str, draw: NDArray[np.int64], slip: Floats, load: Floats
    ) -> Floats:
        """Errors (k,), in the channel's unit, of these draws at slips and loads (k,), N."""
        key = channel, gear
        if key not in self.functions:
            return np.zeros(len(draw))
        functions = self.functions[key].at(np.clip(slip, *self.slip), np.clip(load, *self.load))
        return np.asarray((functions * self.weights[key][draw]).sum(axis=1))

    def amplitude(self, channel: str) -> float:
        """Largest standard deviation of the draws of a channel's error; 0 without one."""
        grid = np.meshgrid(np.linspace(*self.slip, 9), np.geomspace(*self.load, 9))
        at = [values.ravel() for values in grid]
        found = [
            np.sqrt(((f.at(*at) @ self.weights[name, gear].T) ** 2).mean(axis=1).max())
            for (name, gear), f in self.functions.items()
            if name == channel
        ]
        return float(max(found, default=0.0))

    def of_draws(self, index: NDArray[np.int64]) -> DrawnErrors:
        """The errors of some of the draws."""
        return replace(self, weights={key: w[index] for key, w in self.weights.items()})

    def added_to(
        self, force: Force, gear: str, draw: NDArray[np.int64], slip: Floats, load: Floats
    ) -> Force:
        """Forces (k,) of these draws with their errors."""
        own = [name for name, of in self.functions if of == gear]
        errors = {name: self.at(name, gear, draw, slip, load) for name in own}
        return replace(force, **{name: getattr(force, name) + e for name, e in errors.items()})


@dataclass(frozen=True)
class SoilDraws:
    """Draws (n, p) of the parameters `names`, in SI units, and errors of the model of each."""

    names: tuple[str, ...]
    values: Floats
    errors: DrawnErrors | None = None

    def of(self, case: Case, rows: NDArray[np.int64]) -> Case:
        """The case with the values of these draws as arrays of the shape of `rows`."""
        known = case.parameters()
        kept = {n: self.values[rows, i] for i, n in enumerate(self.names) if n in known}
        return case.with_values(kept)

    def of_draws(self, index: NDArray[np.int64]) -> SoilDraws:
        """Some of the draws."""
        errors = None if self.errors is None else self.errors.of_draws(index)
        return SoilDraws(self.names, self.values[index], errors)

    def forces(self, case: Case, draw: NDArray[np.int64], at: Operating, gear: str = "") -> Force:
        """Forces (k,) of a case of one gear, by the draw of each point (k,), with its error.

        gear: Its name, where it is one of several.
        """
        force = forces_of_one_gear(self.of(case, draw), at)
        if self.errors is None:
            return force
        slip, load = (np.asarray(v, dtype=np.float64) for v in (at.slip, at.load))
        return self.errors.added_to(force, gear, draw, slip, load)


#: Loads down to this share of the smallest are in the range of the errors: those on a slope.
ON_SLOPES = 0.5
#: Name of the gear of a case with one.
ONE_GEAR = ""


def draw_model_errors(
    case: Case,
    table: Table,
    draws: SoilDraws,
    slip: Floats,
    load: Sequence[float],
    *,
    channels: Sequence[str] = CHANNELS,
    noise_scale: float | None = 1.0,
) -> tuple[DrawnErrors, DrawnErrors] | None:
    r"""Draws of the errors given the rows, and before them; None where no channel has one.

    A [remainder] of a channel takes the place of what [discrepancy] declares, about its mean, which
    is in the predictions. The error is C w with the columns C of the process and standard normal
    weights w. Given the soil of a draw, the k measured readings leave residuals r with noise D, and
    the weights are normal with

    .. math:: E[w] = M^{-1} B^T D^{-1} r, \quad \operatorname{cov}[w] = M^{-1}, \quad
        M = I + B^T B, \quad B = D^{-1} C

    case: Model, noise and discrepancy.
    table: Rows with status ok. A share of the range is that of their readings, or, where the
        channel was not measured, of the median prediction for these rows.
    draws: Draws of the soil, given the same rows.
    slip, load: Slips and loads (N) at which errors are asked for.
    noise_scale: Factor on noise and discrepancy; None to leave the readings out.

    References: Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, eqs. 2.7 and
    2.8.
    """
    slips, loads = np.append(table["slip"], slip), np.append(table["load_N"], load)
    ranges = _ends(slips), (ON_SLOPES * float(loads.min()), float(loads.max()))
    functions = _functions(case, table, draws, channels, ranges)
    if not functions:
        return None
    rng, after, before = np.random.default_rng(0), {}, {}
    scale = 1.0 if noise_scale is None else noise_scale
    for (channel, gear), own in functions.items():
        normal = rng.standard_normal((2, len(draws.values), own.count))
        residual, std, rows = _residuals(case, table, draws, channel, gear)
        used = np.zeros(len(rows), bool) if noise_scale is None else std > 0.0
        std, residual, rows = std[used], residual[:, used], rows[used]
        basis = own.at(table["slip"][rows], table["load_N"][rows]) / std[:, None]
        precision = np.eye(own.count) + basis.T @ basis
        mean = np.linalg.solve(precision, basis.T @ (residual / std).T).T
        # with M = L L^T, the weights L^-T z have the covariance M^-1
        spread = np.linalg.solve(np.linalg.cholesky(precision).T, normal[1].T).T
        after[channel, gear], before[channel, gear] = mean + scale * spread, scale * normal[0]
    return DrawnErrors(functions, after, *ranges), DrawnErrors(functions, before, *ranges)


def _functions(
    case: Case,
    table: Table,
    draws: SoilDraws,
    channels: Sequence[str],
    ranges: tuple[tuple[float, float], tuple[float, float]],
) -> dict[tuple[str, str], SmoothFunctions]:
    """The functions of each channel and gear that has an error."""
    found = {}
    for name in channels:
        key, learned = column(name), case.remainder
        own = case.discrepancy.get(key)
        for gear in _gears(case):
            if learned is not None and key in learned.columns:
                if learned.of(name, gear):
                    found[name, gear] = learned.error_functions(name, *ranges, gear)
            elif own is not None:
                lengths = own.slip_length, own.log_load_length
                amplitude = own.amplitude(_range(case, table, draws, name))
                columns = partial(_declared_columns, lengths, amplitude)
                found[name, gear] = SmoothFunctions.of(columns, lengths, *ranges)
    return found


def _declared_columns(
    lengths: tuple[float, float], amplitude: float, slip: Floats, load: Floats
) -> Floats:
    return process_columns(slip_load_points(slip, load, *lengths), amplitude)


def _range(case: Case, table: Table, draws: SoilDraws, channel: str) -> float:
    """Range of a channel's readings, or of its median predictions at the rows."""
    key = column(channel)
    if key in table and np.isfinite(table[key]).any():
        return range_with_zero(table[key])
    predicted = [_predicted(case, table, draws, channel, gear)[0] for gear in _gears(case)]
    return range_with_zero(np.concatenate([np.median(own, axis=0) for own in predicted]))


def _gears(case: Case) -> list[str]:
    return list(case.gears) or [ONE_GEAR]


def _residuals(
    case: Case, table: Table, draws: SoilDraws, channel: str, gear: str
) -> tuple[Floats, Floats, NDArray[np.int64]]:
    """Residuals (n, k) of a gear's measured rows, their noise (k,), and their positions (k,)."""
    key = column(channel)
    if key not in table:
        return np.zeros((len(draws.values), 0)), np.zeros(0), np.zeros(0, np.int64)
    predicted, rows = _predicted(case, table, draws, channel, gear)
    reading, std = table[key][rows], np.nan_to_num(declared_std(case, table, key)[rows])
    known = np.isfinite(reading)
    return np.nan_to_num(reading - predicted)[:, known], std[known], rows[known]


def _predicted(
    case: Case, table: Table, draws: SoilDraws, channel: str, gear: str
) -> tuple[Floats, NDArray[np.int64]]:
    """A channel (n, k) of each draw at the rows of a gear, and their positions (k,).

    NaN where the soil does not carry the load.
    """
    soils = draws.of(case, np.arange(len(draws.values))[:, None])
    at, rows = operating_points(table), np.arange(len(table))
    if gear != ONE_GEAR:
        own = [p for p in rows_by_gear(soils, at) if p.name == gear]
        if not own:
            return np.zeros((len(draws.values), 0)), np.zeros(0, np.int64)
        soils, at, rows = own[0].case, own[0].at, own[0].rows
    found = getattr(forces_of_one_gear(soils, at), channel)
    return np.broadcast_to(np.asarray(found), (len(draws.values), len(rows))), rows


def _ends(values: Floats) -> tuple[float, float]:
    return float(values.min()), float(values.max())
