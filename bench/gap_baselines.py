"""What others would do: regressions on residuals, for names and for predictions."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from importlib.util import find_spec

import numpy as np

from soilml.config.case import Case
from soilml.fitting.coordinates import select_free
from soilml.fitting.predictions import linearise, predict
from soilml.fitting.readings import stack_readings
from soilml.gap.evidence.directions import effect_signatures
from soilml.io.table import Table
from soilml.physics.effects import EFFECTS
from soilml.quantities import column


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
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        named = {"residual correlation": _correlated(g, r, labels)}
        if find_spec("pysindy"):  # of the extra `bench`
            named["STLSQ (pysindy)"] = _stlsq(g, r, labels)
        return named | {
            "Lasso, BIC": _lasso(g, r, labels),
            "stepwise, AIC": _stepwise(g, r, j, labels, 2.0),
            "stepwise, BIC": _stepwise(g, r, j, labels, float(np.log(r.size))),
            "random forest sees a gap": _forest(readings.slip, readings.load, readings.channel, r),
        }


def _correlated(g: np.ndarray, r: np.ndarray, labels: list[str]) -> str:
    correlation = [abs(np.corrcoef(column_, r)[0, 1]) for column_ in g.T]
    return labels[int(np.nanargmax(correlation))]


def _largest(weights: np.ndarray, g: np.ndarray, labels: list[str]) -> str:
    share = np.abs(weights) * np.linalg.norm(g, axis=0)
    return labels[int(np.argmax(share))] if share.max() > 0 else ""


def _stlsq(g: np.ndarray, r: np.ndarray, labels: list[str]) -> str:
    import pysindy

    norm = np.linalg.norm(g, axis=0)
    optimizer = pysindy.STLSQ(threshold=1.0, alpha=1e-3)
    optimizer.fit(g / norm, r[:, None])
    return _largest(optimizer.coef_[0] / norm, g, labels)


def _lasso(g: np.ndarray, r: np.ndarray, labels: list[str]) -> str:
    from sklearn.linear_model import LassoLarsIC

    norm = np.linalg.norm(g, axis=0)
    fitted = LassoLarsIC(criterion="bic", noise_variance=1.0).fit(g / norm, r)
    return _largest(fitted.coef_ / norm, g, labels)


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


def _forest(slip: np.ndarray, load: np.ndarray, channel: np.ndarray, r: np.ndarray) -> str:
    """'gap' where a random forest explains residuals it has not seen."""
    from sklearn.ensemble import RandomForestRegressor

    x = np.column_stack([slip, np.log(load), channel])
    forest = RandomForestRegressor(100, oob_score=True, min_samples_leaf=3, random_state=0)
    return "gap" if forest.fit(x, r).oob_score_ > 0.0 else ""


def remainders(
    case: Case,
    table: Table,
    plain: dict[str, np.ndarray],
    region: Table,
    measured: Sequence[str],
    *,
    everything: bool,
) -> dict[str, dict[str, np.ndarray]]:
    """What regressions of the residuals of a soil-only fit on slip and load predict in a region.

    A Gaussian process, and the other regressions where `everything` is wanted.
    """
    from sklearn.ensemble import RandomForestRegressor
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel
    from sklearn.linear_model import Ridge
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import PolynomialFeatures

    def features(rows: Table) -> np.ndarray:
        columns = [rows["slip"] / 0.2, np.log(rows["load_N"]) / 0.4]
        if "gear" in rows:
            columns.append(np.unique(rows["gear"], return_inverse=True)[1])
        return np.column_stack(columns)

    width = features(table).shape[1]

    def process() -> GaussianProcessRegressor:
        kernel = ConstantKernel(10.0, (1e-2, 1e6)) * RBF([1.0] * width, (0.2, 20.0)) + WhiteKernel(
            1.0
        )
        return GaussianProcessRegressor(kernel, random_state=0)

    makers = {"Gaussian process": process}
    others = {
        "random forest": lambda: RandomForestRegressor(200, min_samples_leaf=2, random_state=0),
        "quadratic": lambda: make_pipeline(PolynomialFeatures(2), Ridge(1e-3)),
    }
    makers |= others if everything else {}
    found: dict[str, dict[str, np.ndarray]] = {label: {} for label in makers}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for name in measured:
            key = column(name)
            std = case.noise[key].std(table[key])
            scale = float(np.median(std))
            for label, make in makers.items():
                learned = make().fit(features(table), (table[key] - plain[name]) / scale)
                found[label][name] = learned.predict(features(region)) * scale
    return found
