"""An entry without physics: a Gaussian process on the readings of each channel."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

from datagen.challenge.challenge_files import COLUMNS
from datagen.challenge.house_entries import DRAWS, Answer, SetData
from soilml.arrays import Floats
from soilml.io.table import Table

#: Columns that the process uses where they vary.
COVARIATES = ("speed_m_s", "pass", "slip_angle_rad", "time_s")


def process_entry(data: SetData, seed: int) -> Answer:
    """A Gaussian process of slip, load and covariates; all causes are equally likely to it.

    References: Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, section 2.2.
    """
    features = process_features(data.runs)
    draws = []
    for i, name in enumerate(COLUMNS):
        measured = data.runs[name]
        centre, scale = np.mean(measured), float(np.median(data.case.noise[name].std(measured)))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of lengths at their bounds
            process = gaussian_process(features(data.runs).shape[1])
            process.fit(features(data.runs), (measured - centre) / scale)
            drawn = process.sample_y(features(data.held), DRAWS, random_state=3 * seed + i)
        draws.append(centre + scale * drawn.T)
    return Answer({}, np.stack(draws, axis=-1))


def process_features(table: Table) -> Callable[[Table], Floats]:
    """A function that gives slip, load and what varies in a table as features (rows, q)."""
    varied = [name for name in COVARIATES if name in table and np.ptp(table[name]) > 0.0]

    def features(rows: Table) -> Floats:
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
