"""The result of a gap analysis."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case

Floats = NDArray[np.float64]

#: Status of a report, and its meaning.
STATUSES = {
    "no-gap": "model and measurements agree within the noise",
    "named": "exactly one effect of the catalogue explains the gap",
    "class": "several effects explain the gap equally well; these runs cannot distinguish them",
    "form-open": "one effect explains the gap, with a law that differs from the catalogue's",
    "unknown": "there is a gap, and no effect of the catalogue explains it",
    "not-testable": "there is a gap, but these runs cannot identify its cause",
    "bad-data": "the data cannot be analysed",
}


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


@dataclass(frozen=True)
class Discrepancy:
    """A region of the data with its score against the soil alone and its family-wise p value."""

    channel: str
    slip: tuple[float, float]
    load_N: tuple[float, float]  # noqa: N815 - the name of the column
    z: float
    p: float


@dataclass(frozen=True)
class GapReduction:
    """Mean squared standardised residual before and after, in all and by channel; noise gives 1."""

    before: float
    after: float
    channels: dict[str, tuple[float, float]]
    readings: int
    description: str

    def unchanged(self) -> GapReduction:
        """The figures of a model to which nothing was added."""
        same = {name: (before, before) for name, (before, _) in self.channels.items()}
        return replace(self, after=self.before, channels=same)

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


@dataclass(frozen=True)
class NextRun:
    """A proposed run or check, with the predictions of each explanation."""

    kind: str
    text: str
    discrimination: float  # expected, in sigma, between the remaining explanations
    rows: tuple[dict[str, float], ...]  # operating points and predictions of each explanation


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


@dataclass(frozen=True)
class GapReport:
    """The result of a gap analysis, made by `soilml.gap.gap`.

    Attributes
    ----------
    status : str
        One of `STATUSES`.
    sentence : str
        The verdict in one sentence.
    model : Case
        The fitted model; it contains an effect only where one is claimed.
    effects : tuple of NamedEffect
        The effects that were added.
    cause_set : tuple of tuple of str
        The explanations that the data do not reject, as sets of effect names, the best first.
    best_unclaimed : tuple of str
        The candidate that fits best where no cause is claimed; it is not in `model`.
    reasons : tuple of str
        Why no cause can be named, or why the data cannot be analysed.
    where : tuple of Discrepancy
        Regions of the data, the largest disagreement first.
    gap : dict of GapReduction
        Figures of the fitted rows (`train`) and of held-out runs and regions.
    soil_before, soil_after : dict of EstimatedValue
        Soil parameters without and with the added effects.
    mimic_radius : float
        Largest cosine between the signature of an added effect and that of another one.
    next_runs : tuple of NextRun
        Proposed runs and checks, the most discriminating first.
    candidates : tuple of CandidateSummary
        All fitted candidates, the best first.
    untestable : dict of str
        Effects that these runs cannot test, with the reason.
    not_claimed : tuple of str
        Conclusions that the report does not support.
    variance_components : dict of float
        Estimated noise scales, run-to-run standard deviations and autocorrelation.
    residual_trend : dict of float
        Unexplained smooth trend by channel, in sigma.
    p_gap, p_residual : float
        Family-wise p values of the soil alone and of the best candidate.
    """

    status: str
    sentence: str
    model: Case
    effects: tuple[NamedEffect, ...] = ()
    cause_set: tuple[tuple[str, ...], ...] = ()
    best_unclaimed: tuple[str, ...] = ()
    reasons: tuple[str, ...] = ()
    where: tuple[Discrepancy, ...] = ()
    gap: dict[str, GapReduction] = field(default_factory=dict)
    soil_before: dict[str, EstimatedValue] = field(default_factory=dict)
    soil_after: dict[str, EstimatedValue] = field(default_factory=dict)
    mimic_radius: float = 0.0
    next_runs: tuple[NextRun, ...] = ()
    candidates: tuple[CandidateSummary, ...] = ()
    untestable: dict[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    not_claimed: tuple[str, ...] = ()
    variance_components: dict[str, float] = field(default_factory=dict)
    residual_trend: dict[str, float] = field(default_factory=dict)
    p_gap: float = 1.0
    p_residual: float = 1.0
    seed: int = 0
    curves: ReadingsAndPredictions | None = None

    def as_json(self) -> dict[str, Any]:
        """The content of gap.json."""
        from soilml import __version__

        return {
            "status": self.status,
            "sentence": self.sentence,
            "effects": [
                {
                    "name": e.name,
                    "parameters": {k: v.as_json() for k, v in e.parameters.items()},
                    "alternatives": list(e.alternatives),
                    "separating_snr": e.separating_snr,
                    "nearest_rival": e.nearest_rival,
                }
                for e in self.effects
            ],
            "cause_set": [list(names) for names in self.cause_set],
            "fits_best_but_not_claimed": list(self.best_unclaimed),
            "reasons": list(self.reasons),
            "where": [
                {
                    "channel": w.channel,
                    "slip": list(w.slip),
                    "load_N": list(w.load_N),
                    "z": w.z,
                    "p": w.p,
                }
                for w in self.where
            ],
            "gap": {name: figures.as_json() for name, figures in self.gap.items()},
            "p_gap": self.p_gap,
            "p_left": self.p_residual,
            "soil": {
                "before": {k: v.as_json() for k, v in self.soil_before.items()},
                "after": {k: v.as_json() for k, v in self.soil_after.items()},
            },
            "mimic_radius": self.mimic_radius,
            "candidates": [
                {
                    "effects": list(t.names),
                    "predicted_gain": t.predicted_gain,
                    "realised_gain": t.achieved_gain,
                    "behind_best": t.excess,
                    "verdict": t.verdict,
                }
                for t in self.candidates
            ],
            "next_runs": [
                {"kind": n.kind, "text": n.text, "separates_sigma": n.discrimination}
                for n in self.next_runs
            ],
            "unnamed_remainder": self.residual_trend,
            "not_testable": self.untestable,
            "scatter": self.variance_components,
            "notes": list(self.notes),
            "not_claimed": list(self.not_claimed),
            "seed": self.seed,
            "soilml_version": __version__,
        }


def decimal(value: float, digits: int = 3) -> str:
    """A number with this many significant digits, never with a power of ten."""
    if not math.isfinite(value):
        return f"{value:g}"
    exponent = 0 if value == 0.0 else math.floor(math.log10(abs(value)))
    return f"{value:.{max(0, digits - 1 - exponent)}f}"
