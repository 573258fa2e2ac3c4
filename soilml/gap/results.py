"""The answer of a gap analysis."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case

Floats = NDArray[np.float64]

#: What a report may say, and what it means.
STATUSES = {
    "no-gap": "model and measurements agree within their noise",
    "named": "one effect of the catalogue explains the gap, and no other does",
    "class": "several effects explain the gap equally well; these runs cannot tell them apart",
    "form-open": "one effect explains the gap, by another law than the catalogue's",
    "unknown": "there is a gap, and nothing in the catalogue explains it",
    "not-testable": "there is a gap, but these runs cannot tell causes apart",
    "bad-data": "the data cannot be analysed",
}


@dataclass(frozen=True)
class Value:
    """A parameter with its standard deviation."""

    value: float
    std: float
    unit: str

    def as_json(self) -> dict[str, Any]:
        """As it stands in gap.json."""
        return {"value": self.value, "std": self.std, "unit": self.unit}


@dataclass(frozen=True)
class NamedEffect:
    """An effect that was added: its parameters, what explains the data as well, how well apart."""

    name: str
    parameters: dict[str, Value]
    alternatives: tuple[str, ...]
    #: sigma by which its signature at this size stands out from soil and its nearest rival
    separating_snr: float
    nearest_rival: str


@dataclass(frozen=True)
class Where:
    """A corner of the data, its score against the soil alone, and its family-wise p value."""

    channel: str
    slip: tuple[float, float]
    load_N: tuple[float, float]  # noqa: N815 - the name of the column
    z: float
    p: float


@dataclass(frozen=True)
class Shrink:
    """Mean squared whitened residual before and after, in all and by channel; 1 is the noise."""

    before: float
    after: float
    channels: dict[str, tuple[float, float]]
    cells: int
    what: str

    def unchanged(self) -> Shrink:
        """The figures of a model to which nothing was added."""
        same = {name: (before, before) for name, (before, _) in self.channels.items()}
        return replace(self, after=self.before, channels=same)

    def as_json(self) -> dict[str, Any]:
        """As it stands in gap.json."""
        return {
            "before": self.before,
            "after": self.after,
            "channels": {k: {"before": b, "after": a} for k, (b, a) in self.channels.items()},
            "cells": self.cells,
            "what": self.what,
        }


@dataclass(frozen=True)
class Tried:
    """A candidate: how much lower the objective should, and did, become, and what came of it."""

    names: tuple[str, ...]
    predicted_gain: float
    realised_gain: float
    behind: float  # objective above the best one's
    verdict: str


@dataclass(frozen=True)
class NextRun:
    """A run worth driving: how it would separate what is left, and what it should measure."""

    kind: str
    text: str
    separates: float  # sigma between the explanations that are left
    rows: tuple[dict[str, float], ...]  # operating points and predictions of each explanation


@dataclass(frozen=True)
class Curves:
    """Measured cells with the predictions before and after, for pictures."""

    channels: tuple[str, ...]
    channel: NDArray[np.int64]
    run: tuple[str, ...]  # of each cell
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
    """What a gap analysis found; see `STATUSES` for what it may say."""

    status: str
    sentence: str
    model: Case
    effects: tuple[NamedEffect, ...] = ()
    cause_set: tuple[tuple[str, ...], ...] = ()
    #: what fits best where nothing is claimed; it is not in `model`
    stand_in: tuple[str, ...] = ()
    reasons: tuple[str, ...] = ()
    where: tuple[Where, ...] = ()
    gap: dict[str, Shrink] = field(default_factory=dict)
    soil_before: dict[str, Value] = field(default_factory=dict)
    soil_after: dict[str, Value] = field(default_factory=dict)
    mimic_radius: float = 0.0
    next_runs: tuple[NextRun, ...] = ()
    tried: tuple[Tried, ...] = ()
    untestable: dict[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    not_claimed: tuple[str, ...] = ()
    scatter: dict[str, float] = field(default_factory=dict)
    remainder: dict[str, float] = field(default_factory=dict)
    p_gap: float = 1.0
    p_left: float = 1.0
    seed: int = 0
    curves: Curves | None = None

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
            "fits_best_but_not_claimed": list(self.stand_in),
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
            "gap": {name: shrink.as_json() for name, shrink in self.gap.items()},
            "p_gap": self.p_gap,
            "p_left": self.p_left,
            "soil": {
                "before": {k: v.as_json() for k, v in self.soil_before.items()},
                "after": {k: v.as_json() for k, v in self.soil_after.items()},
            },
            "mimic_radius": self.mimic_radius,
            "candidates": [
                {
                    "effects": list(t.names),
                    "predicted_gain": t.predicted_gain,
                    "realised_gain": t.realised_gain,
                    "behind_best": t.behind,
                    "verdict": t.verdict,
                }
                for t in self.tried
            ],
            "next_runs": [
                {"kind": n.kind, "text": n.text, "separates_sigma": n.separates}
                for n in self.next_runs
            ],
            "unnamed_remainder": self.remainder,
            "not_testable": self.untestable,
            "scatter": self.scatter,
            "notes": list(self.notes),
            "not_claimed": list(self.not_claimed),
            "seed": self.seed,
            "soilml_version": __version__,
        }
