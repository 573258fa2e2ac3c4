"""What others would do: regressions on residuals, for names and for predictions."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from soilml.config.case import Case
from soilml.fitting.coordinates import select_free
from soilml.fitting.effect_signatures import effect_signatures
from soilml.fitting.operating_points import operating_points
from soilml.fitting.predictions import forces, linearise, predict
from soilml.fitting.readings import stack_readings
from soilml.io.table import Table
from soilml.physics.effects import EFFECTS
from soilml.quantities import CHANNELS, column


def names(soil_only: Case, table: Table, case: Case) -> dict[str, str]:
    """The effect that each baseline names, '' where it sees no gap."""
    readings = stack_readings(case, table)
    effects = {name: e for name, e in EFFECTS.items() if e.applies_to(case.model.gear)}
    known, _ = effect_signatures(soil_only, readings, effects)
    y = predict(soil_only, [], np.zeros((1, 0)), readings)[0]
    r = (readings.measured - y) / readings.std
    g = np.stack([s.column for s in known], axis=1) / readings.std[:, None]
    labels = [s.name for s in known]
    free = select_free(case, None)
    at = np.asarray([f.prior.fraction(float(soil_only.parameters()[f.path][1])) for f in free])
    j = linearise(case, free, at, readings).jacobian / readings.std[:, None]
    return {
        "residual correlation": _correlated(g, r, labels),
        "Lasso, BIC": _largest(lasso_weights(g, r), g, labels),
        "stepwise, BIC": _stepwise(g, r, j, labels, float(np.log(r.size))),
    }


def _correlated(g: np.ndarray, r: np.ndarray, labels: list[str]) -> str:
    correlation = [abs(np.corrcoef(column_, r)[0, 1]) for column_ in g.T]
    return labels[int(np.nanargmax(correlation))]


def _largest(weights: np.ndarray, g: np.ndarray, labels: list[str]) -> str:
    share = np.abs(weights) * np.linalg.norm(g, axis=0)
    return labels[int(np.argmax(share))] if share.max() > 0 else ""


def lasso_weights(signatures: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """Weights (k,) of signatures (m, k) of residuals (m,) in noise, by the Lasso with BIC."""
    from sklearn.linear_model import LassoLarsIC

    norm = np.maximum(np.linalg.norm(signatures, axis=0), 1e-12)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of steps that rounding makes too small
        fitted = LassoLarsIC(criterion="bic", noise_variance=1.0).fit(signatures / norm, residual)
    return np.asarray(fitted.coef_ / norm)


def _stepwise(
    g: np.ndarray, r: np.ndarray, j: np.ndarray, labels: list[str], penalty: float
) -> str:
    """The first effect that a joint regression of soil and effects takes in."""

    def left(columns: np.ndarray) -> float:
        weights = np.linalg.lstsq(columns, r, rcond=None)[0]
        return float(np.sum((r - columns @ weights) ** 2))

    base = left(j)
    costs = [left(np.column_stack([j, column_])) + penalty for column_ in g.T]
    best = int(np.argmin(costs))
    return labels[best] if costs[best] < base else ""


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


#: Regressions of the residuals of a soil-only fit; the others are of the readings themselves.
BESIDE_SOIL = ("Gaussian process", "quadratic")


def learned(
    case: Case,
    table: Table,
    plain: dict[str, np.ndarray],
    parts: Sequence[Table],
    measured: Sequence[str],
) -> dict[str, list[dict[str, np.ndarray]]]:
    """What regressions on slip, load and covariates predict for other rows, by label and part.

    Those of `BESIDE_SOIL` are of the residuals of a soil-only fit, whose predictions at the rows of
    the table are `plain`; what they predict is to be added to the soil's. The others know no
    physics.
    """
    from sklearn.ensemble import GradientBoostingRegressor
    from sklearn.linear_model import Ridge
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import PolynomialFeatures

    features = process_features(table)
    x = features(table)

    def process() -> Any:
        return gaussian_process(x.shape[1])

    makers: dict[str, Callable[[], Any]] = {
        "Gaussian process": process,
        "quadratic": lambda: make_pipeline(PolynomialFeatures(2), Ridge(1e-3)),
        "process of readings": process,
        "ridge": lambda: make_pipeline(PolynomialFeatures(2), Ridge(1e-3)),
        "boosted trees": lambda: GradientBoostingRegressor(random_state=0, min_samples_leaf=3),
    }
    found: dict[str, list[dict[str, np.ndarray]]] = {label: [{} for _ in parts] for label in makers}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for name in measured:
            scale = float(np.median(case.noise[column(name)].std(table[column(name)])))
            for label, make in makers.items():
                base = plain[name] if label in BESIDE_SOIL else np.mean(table[column(name)])
                model = make().fit(x, (table[column(name)] - base) / scale)
                for part, rows in zip(found[label], parts, strict=True):
                    added = model.predict(features(rows)) * scale
                    part[name] = added if label in BESIDE_SOIL else added + base
    return found


def predicted(case: Case, rows: Table) -> dict[str, np.ndarray]:
    """Predictions (rows,) of each channel, with the mean of the remainder."""
    force = forces(case, operating_points(rows))
    return {name: np.asarray(getattr(force, name)) for name in CHANNELS}


def process_of_readings(case: Case, learned: Table, rows: Table) -> dict[str, np.ndarray]:
    """Predictions of a Gaussian process of the readings, by slip, load and gear."""
    names = [name for name in ("slip", "load_N", "gear") if name in learned]
    features, found = process_features(Table({name: learned[name] for name in names})), {}
    for name in CHANNELS:
        known = np.isfinite(learned[column(name)])
        if not known.any():
            continue
        reading = learned[column(name)][known]
        scale = float(np.median(case.noise[column(name)].std(reading)))
        process = gaussian_process(features(learned).shape[1])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            process.fit(features(learned)[known], (reading - reading.mean()) / scale)
        found[name] = reading.mean() + scale * process.predict(features(rows))
    return found
