"""Fusion of soil estimates from torque, vibration and sinkage, compared over several rules."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats
from soilml.errors import FitError
from soilml.onboard.fusion_rules import FusedEstimate, best_linear, inverse_variance, pairwise
from soilml.systems.wheel_legs.slip_models import GRAVITY, PRESSURE
from soilml.systems.wheel_legs.stances import StanceReadings

Rule = Callable[[Floats, Floats, Floats | None], FusedEstimate]

#: The rules of Comin and Saaj 2017 (eq. 30), for independent errors (eq. 26), and for any errors.
RULES: dict[str, Rule] = {
    "pairwise": pairwise,
    "inverse variance": inverse_variance,
    "best linear": best_linear,
}
SENSORS = ("torque", "vibration", "sinkage")
PROPERTIES = ("friction_angle", "normal_stiffness")
#: Fewest stances from which three linear estimators and their error covariance are fitted.
MIN_STANCES = 20


@dataclass(frozen=True)
class SensorEstimators:
    """Three linear estimators of one soil property, one for each sensor, and their errors.

    `coefficients` by sensor multiply the features of that sensor; `std` (3,) and `correlation`
    (3, 3) of the errors are those of the training stances. Units: rad for the friction angle, Pa
    for the stiffness.
    """

    name: str
    coefficients: dict[str, Floats]
    std: Floats
    correlation: Floats

    def estimates(self, stances: StanceReadings) -> Floats:
        """The estimate of each sensor for every stance, (3, stances)."""
        features = _features(stances, self.name)
        return np.stack([features[sensor] @ self.coefficients[sensor] for sensor in SENSORS])

    def fused(self, stances: StanceReadings, rule: str) -> FusedEstimate:
        """Fused estimate for every stance by a rule of `RULES`."""
        estimates = self.estimates(stances)
        std = np.repeat(self.std[:, None], estimates.shape[1], axis=1)
        return RULES[rule](estimates, std, self.correlation)


@dataclass(frozen=True)
class EstimatorScore:
    """Error of an estimate on test stances, and the coverage of its intervals."""

    rmse: float
    predicted_std: float  # mean over the stances
    coverage_68: float  # fraction of true values within one predicted std, 0.68 if calibrated
    coverage_95: float  # ... within 1.96, 0.95


def fit_estimators(stances: StanceReadings, name: str) -> SensorEstimators:
    """Fit linear estimators of a property to stances on known soils by least squares.

    The features are those of the source: the slope (i + 0.33) / T of the simplified torque model,
    vibration and slip, and sinkage or its inverse. Raises `FitError` for fewer than `MIN_STANCES`.
    References: Comin and Saaj 2017, eqs. 27 to 29.
    """
    truth = _true_values(stances, name)
    if len(truth) < MIN_STANCES:
        raise FitError(
            f"{len(truth)} stances are given; {MIN_STANCES} or more are needed for the fit"
        )
    coefficients: dict[str, Floats] = {}
    errors = []
    for sensor, features in _features(stances, name).items():
        coefficients[sensor] = np.asarray(np.linalg.lstsq(features, truth, rcond=None)[0])
        errors.append(features @ coefficients[sensor] - truth)
    return SensorEstimators(name, coefficients, np.std(errors, axis=1, ddof=3), np.corrcoef(errors))


def score_estimators(
    estimators: SensorEstimators, stances: StanceReadings
) -> dict[str, EstimatorScore]:
    """Score each sensor alone, and each fusion rule, on test stances."""
    truth = _true_values(stances, estimators.name)
    alone = zip(SENSORS, estimators.estimates(stances), estimators.std, strict=True)
    scores = {sensor: _score(mean, std + 0.0 * truth, truth) for sensor, mean, std in alone}
    for rule in RULES:
        fused = estimators.fused(stances, rule)
        scores[rule] = _score(fused.mean, fused.std, truth)
    return scores


def _score(mean: Floats, std: Floats, truth: Floats) -> EstimatorScore:
    error = np.abs(mean - truth)
    return EstimatorScore(
        rmse=float(np.sqrt(np.mean(error**2))),
        predicted_std=float(np.mean(std)),
        coverage_68=float(np.mean(error < std)),
        coverage_95=float(np.mean(error < 1.96 * std)),
    )


def _true_values(stances: StanceReadings, name: str) -> Floats:
    ground = stances.ground
    if name == PROPERTIES[1]:
        return np.asarray(ground.normal_stiffness)
    return np.asarray(ground.soil.friction_angle)


def _features(stances: StanceReadings, name: str) -> dict[str, Floats]:
    """Features of each sensor's linear estimator, (stances, terms), by sensor."""
    one, depth = np.ones_like(stances.slip), 100.0 * stances.sinkage
    scale = PRESSURE if name == PROPERTIES[1] else 1.0
    deep = 1.0 / depth if name == PROPERTIES[1] else depth
    return {
        "torque": scale * np.column_stack([one, (stances.slip + 0.33) / stances.torque]),
        "vibration": scale * np.column_stack([one, stances.vibration / GRAVITY, stances.slip]),
        "sinkage": scale * np.column_stack([one, deep]),
    }
