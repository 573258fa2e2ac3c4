"""What others would do: Gaussian processes of the readings, with the soil alone and without it."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from soilml.config.case import Case
from soilml.fitting.operating_points import operating_points
from soilml.fitting.predictions import forces
from soilml.io.table import Table
from soilml.quantities import CHANNELS, column

#: Columns that a process uses where they vary.
COVARIATES = ("speed_m_s", "pass", "slip_angle_rad", "time_s")


def process_features(table: Table) -> Callable[[Table], np.ndarray]:
    """A function that gives slip, load and what varies in a table as features (rows, q)."""
    varied = [name for name in COVARIATES if name in table and np.ptp(table[name]) > 0.0]

    def features(rows: Table) -> np.ndarray:
        columns: list[Any] = [rows["slip"] / 0.2, np.log(rows["load_N"]) / 0.4]
        columns += [rows[name] / np.ptp(table[name]) for name in varied]
        if "gear" in rows:
            columns.append(np.unique(rows["gear"], return_inverse=True)[1])
        return np.column_stack(columns)

    return features


def gaussian_process(dimensions: int) -> Any:
    """A regressor of scikit-learn for readings in units of their noise."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    kernel = ConstantKernel(10.0, (1e-2, 1e6)) * RBF([1.0] * dimensions, (0.2, 20.0))
    return GaussianProcessRegressor(kernel + WhiteKernel(1.0), random_state=0)


def process_of(
    case: Case, learned: Table, rows: Sequence[Table], base: dict[str, Any] | None = None
) -> list[dict[str, np.ndarray]]:
    """What a process of each measured channel predicts for other rows (k,), by part and channel.

    base: Predictions (rows,) whose residuals it is of; by default the mean of the readings, which
        it then adds.
    """
    features = process_features(learned)
    found: list[dict[str, np.ndarray]] = [{} for _ in rows]
    for name in CHANNELS:
        reading = learned[column(name)]
        known = np.isfinite(reading)
        if not known.any():
            continue
        scale = float(np.median(case.noise[column(name)].std(reading[known])))
        middle = float(np.mean(reading[known]))
        off = (reading - (middle if base is None else base[name])) / scale
        process = gaussian_process(features(learned).shape[1])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            process.fit(features(learned)[known], off[known])
        for part, at in zip(found, rows, strict=True):
            part[name] = scale * process.predict(features(at)) + (middle if base is None else 0.0)
    return found


def predicted(case: Case, rows: Table) -> dict[str, np.ndarray]:
    """Predictions (rows,) of each channel, with the mean of the remainder; each gear's own rows."""
    if "gear" in rows:
        found = {name: np.full(len(rows), np.nan) for name in CHANNELS}
        plain = Table({name: v for name, v in rows.columns.items() if name != "gear"})
        for gear in case.gears:
            own = rows["gear"] == gear
            for name, values in predicted(case.of_gear(gear), plain.rows(own)).items():
                found[name][own] = values
        return found
    force = forces(case, operating_points(rows))
    return {name: np.asarray(getattr(force, name)) for name in CHANNELS}


def process_of_readings(case: Case, learned: Table, rows: Table) -> dict[str, np.ndarray]:
    """Predictions of a Gaussian process of the readings, by slip, load and gear."""
    names = [n for n in ("slip", "load_N", "gear", *map(column, CHANNELS)) if n in learned]
    blank = {column(n): np.full(len(learned), np.nan) for n in CHANNELS}
    plain = Table(blank | {name: learned[name] for name in names})
    return process_of(case, plain, [rows])[0]
