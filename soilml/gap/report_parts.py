"""Entries of a gap report."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class EstimatedValue:
    """An estimated parameter with its standard deviation."""

    value: float
    std: float
    unit: str

    def as_json(self) -> dict[str, Any]:
        """Its entry in gap.json."""
        return {"value": self.value, "std": self.std, "unit": self.unit}


@dataclass(frozen=True)
class NamedEffect:
    """An effect that was added to the model, with its parameters and its alternatives."""

    name: str
    parameters: dict[str, EstimatedValue]
    #: effects of the other explanations that the data do not reject
    alternatives: tuple[str, ...]
    #: sigma that distinguish the effect, at its size, from the soil and its nearest rival
    separating_snr: float
    nearest_rival: str
    #: posterior probability that the effect is present, and the natural logarithm of its odds
    probability: float
    log_odds: float

    def as_json(self) -> dict[str, Any]:
        """Its entry in gap.json."""
        return {
            "name": self.name,
            "parameters": {k: v.as_json() for k, v in self.parameters.items()},
            "alternatives": list(self.alternatives),
            "separating_snr": self.separating_snr,
            "nearest_rival": self.nearest_rival,
            "probability": self.probability,
            "log_odds": self.log_odds,
        }


@dataclass(frozen=True)
class Suspect:
    """An explanation with its odds against all others, and their conditions in words."""

    effects: tuple[str, ...]
    log_odds: float  # natural logarithm
    given: str

    def as_json(self) -> dict[str, Any]:
        """Its entry in gap.json."""
        return {"effects": list(self.effects), "log_odds": self.log_odds, "given": self.given}


@dataclass(frozen=True)
class RemainingDiscrepancy:
    """Smooth discrepancy of a channel, root mean square over its readings, before and after."""

    unit: str
    before_value: float
    after_value: float
    before_sigma: float
    after_sigma: float
    #: where the discrepancy after is largest, in words
    description: str

    def as_json(self) -> dict[str, Any]:
        """Its entry in gap.json."""
        return {
            "before": {"value": self.before_value, "unit": self.unit, "sigma": self.before_sigma},
            "after": {"value": self.after_value, "unit": self.unit, "sigma": self.after_sigma},
            "where": self.description,
        }


@dataclass(frozen=True)
class Discrepancy:
    """A region of the data with its score against the soil alone and its family-wise p value."""

    channel: str
    slip: tuple[float, float]
    load_N: tuple[float, float]  # noqa: N815 - the name of the column
    z: float
    p: float

    def as_json(self) -> dict[str, Any]:
        """Its entry in gap.json."""
        return {
            "channel": self.channel,
            "slip": list(self.slip),
            "load_N": list(self.load_N),
            "z": self.z,
            "p": self.p,
        }


@dataclass(frozen=True)
class GapReduction:
    """Mean squared standardised residual before and after, in all and by channel; noise gives 1."""

    before: float
    after: float
    channels: dict[str, tuple[float, float]]
    readings: int
    description: str

    def as_json(self) -> dict[str, Any]:
        """Its entry in gap.json."""
        return {
            "before": self.before,
            "after": self.after,
            "channels": {k: {"before": b, "after": a} for k, (b, a) in self.channels.items()},
            "cells": self.readings,
            "what": self.description,
        }


@dataclass(frozen=True)
class CandidateSummary:
    """A candidate: predicted and achieved decrease of the objective, and its verdict."""

    names: tuple[str, ...]
    predicted_gain: float
    achieved_gain: float
    excess: float  # objective above that of the best candidate
    verdict: str

    def as_json(self) -> dict[str, Any]:
        """Its entry in gap.json."""
        return {
            "effects": list(self.names),
            "predicted_gain": self.predicted_gain,
            "realised_gain": self.achieved_gain,
            "behind_best": self.excess,
            "verdict": self.verdict,
        }


@dataclass(frozen=True)
class NextRun:
    """A proposed run or check, with the predictions of each explanation."""

    kind: str
    text: str
    discrimination: float  # expected, in sigma, between the remaining explanations
    rows: tuple[dict[str, float | str], ...]  # operating points and predictions of each explanation
    cost: float | None = None  # where costs are given, in their unit


@dataclass(frozen=True)
class ReadingsAndPredictions:
    """Readings (m,) with the predictions before and after, for figures."""

    channels: tuple[str, ...]
    channel: NDArray[np.int64]
    run: tuple[str, ...]  # of each reading
    slip: Floats
    load: Floats
    reading: Floats
    std: Floats
    before: Floats
    after: Floats
    after_std: Floats
    held_out: NDArray[np.bool_]
