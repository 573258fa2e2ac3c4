"""Torque, vibration and sinkage each say something of the soil: which rule joins them best."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.errors import FitError
from soilml.numerics.estimate_fusion import FusedEstimate, best_linear, inverse_variance, pairwise
from soilml.systems.wheel_legs.sensing.simulated_stances import Felt
from soilml.systems.wheel_legs.sensing.slip_models import GRAVITY, PRESSURE

Floats = NDArray[np.float64]
Rule = Callable[[Floats, Floats, Floats | None], FusedEstimate]

#: The rules of Comin and Saaj 2017 (eq. 30), for independent errors (eq. 26), and for any errors.
RULES: dict[str, Rule] = {
    "pairwise": pairwise,
    "inverse variance": inverse_variance,
    "best linear": best_linear,
}
SENSES = ("torque", "vibration", "sinkage")
PROPERTIES = ("friction_angle", "normal_stiffness")
#: Stances needed to learn three lines and their errors from.
FEWEST = 20


@dataclass(frozen=True)
class Senses:
    """Three linear estimators of one property of the soil, and the errors that they make.

    `coefficients` by sense act on `_features`; `std` (3,) and `correlation` (3, 3) of their errors
    come from the stances learned from. Units: rad for the friction angle, Pa for the stiffness.
    """

    name: str
    coefficients: dict[str, Floats]
    std: Floats
    correlation: Floats

    def estimates(self, stances: Felt) -> Floats:
        """What each sense says of every stance, (3, stances)."""
        features = _features(stances, self.name)
        return np.stack([features[sense] @ self.coefficients[sense] for sense in SENSES])

    def joined(self, stances: Felt, rule: str) -> FusedEstimate:
        """One estimate for every stance by a rule of `RULES`."""
        found = self.estimates(stances)
        std = np.repeat(self.std[:, None], found.shape[1], axis=1)
        return RULES[rule](found, std, self.correlation)


@dataclass(frozen=True)
class FusedSensors:
    """Error of an estimate on stances not learned from, and how often its claim held."""

    rmse: float
    claimed: float  # std that the rule claims
    within_one: float  # share of truths within one std claimed, 0.68 if true
    within_two: float  # ... two, 0.95


def learned(stances: Felt, name: str) -> Senses:
    """Linear estimators of a property from stances on known soils, by least squares.

    Of the forms of the source: the slope (i + 0.33) / T of the simplified torque model, vibration
    and slip, and sinkage or its inverse. References: Comin and Saaj 2017, eqs. 27 to 29.
    """
    truth = _truth(stances, name)
    if len(truth) < FEWEST:
        raise FitError(f"{len(truth)} stances are given; {FEWEST} or more are needed to learn from")
    coefficients: dict[str, Floats] = {}
    errors = []
    for sense, features in _features(stances, name).items():
        coefficients[sense] = np.asarray(np.linalg.lstsq(features, truth, rcond=None)[0])
        errors.append(features @ coefficients[sense] - truth)
    return Senses(name, coefficients, np.std(errors, axis=1, ddof=3), np.corrcoef(errors))


def judged(senses: Senses, stances: Felt) -> dict[str, FusedSensors]:
    """Each sense alone, and each rule, on stances not learned from."""
    truth = _truth(stances, senses.name)
    alone = zip(SENSES, senses.estimates(stances), senses.std, strict=True)
    found = {sense: _judged(mean, std + 0.0 * truth, truth) for sense, mean, std in alone}
    for rule in RULES:
        fused = senses.joined(stances, rule)
        found[rule] = _judged(fused.mean, fused.std, truth)
    return found


def _judged(mean: Floats, std: Floats, truth: Floats) -> FusedSensors:
    error = np.abs(mean - truth)
    return FusedSensors(
        rmse=float(np.sqrt(np.mean(error**2))),
        claimed=float(np.mean(std)),
        within_one=float(np.mean(error < std)),
        within_two=float(np.mean(error < 1.96 * std)),
    )


def _truth(stances: Felt, name: str) -> Floats:
    ground = stances.ground
    return ground.normal_stiffness if name == PROPERTIES[1] else ground.soil.friction_angle


def _features(stances: Felt, name: str) -> dict[str, Floats]:
    """What each sense's line reads, (stances, terms), by sense."""
    one, depth = np.ones_like(stances.slip), 100.0 * stances.sinkage
    scale = PRESSURE if name == PROPERTIES[1] else 1.0
    deep = 1.0 / depth if name == PROPERTIES[1] else depth
    return {
        "torque": scale * np.column_stack([one, (stances.slip + 0.33) / stances.torque]),
        "vibration": scale * np.column_stack([one, stances.vibration / GRAVITY, stances.slip]),
        "sinkage": scale * np.column_stack([one, deep]),
    }
