"""Scores of entries, which are proper, with intervals over sets and paired differences."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from datagen.challenge.challenge_files import COLUMNS, Challenge, Entry, Truth
from soilml.arrays import Floats
from soilml.io.text_tables import format_table

#: Resamples of the sets, and the ends of the intervals.
RESAMPLES, ENDS = 4000, (0.05, 0.95)
CAUSES = "causes"


@dataclass(frozen=True)
class Scores:
    """Scores (sets,) of one entry by `CAUSES` and by column.

    Of causes the natural logarithm of the probability of the right one: higher is better. Of a
    column the mean CRPS over rows, in the noise unit of `Truth`: lower is better.
    """

    name: str
    by_set: dict[str, Floats]


def crps(draws: Floats, reading: Floats) -> Floats:
    r"""Continuous ranked probability score of draws (d, ...) for readings (...), in their unit.

    .. math::
        \frac{1}{d} \sum_i |x_i - y| - \frac{1}{2 d (d - 1)} \sum_{i, j} |x_i - x_j|

    With d - 1 in place of d the expectation does not depend on the number of draws; it may then
    be slightly negative.

    References: Gneiting and Raftery, Strictly proper scoring rules, prediction, and estimation,
    JASA 102, 2007, eq. 21; Ferro, Fair scores for ensemble forecasts, Q. J. R. Meteorol. Soc. 140,
    2014.

    >>> crps(np.asarray([[0.0], [2.0]]), np.asarray([1.0]))
    array([0.])
    """
    count = len(draws)
    ranked = np.sort(draws, axis=0)
    weight = 2.0 * np.arange(1, count + 1) - count - 1.0
    spread = np.tensordot(weight, ranked, axes=1) / (count * (count - 1))
    return np.asarray(np.abs(draws - reading).mean(axis=0) - spread)


def score(challenge: Challenge, truth: Truth, entry: Entry) -> Scores:
    """Score an entry in every set.

    References: Gneiting and Raftery, JASA 102, 2007, sections 3.1 (logarithmic score) and 4.2. The
    unit of the CRPS is known before a reading is, so that it stays proper.
    """
    logs, ranked = [], []
    for name in challenge.rows:
        logs.append(np.log(entry.probabilities[name][challenge.causes.index(truth.answer[name])]))
        of_rows = crps(entry.draws[name], truth.readings[name])
        ranked.append(of_rows.mean(axis=0) / truth.noise[name])
    columns = np.asarray(ranked).T
    by_column = dict(zip(COLUMNS, columns, strict=True))
    return Scores(entry.name, {CAUSES: np.asarray(logs), **by_column})


def bootstrap(values: Floats) -> tuple[float, float, float]:
    """Mean of values (sets,), and the ends of its 90 % interval by resampling of sets.

    All calls resample the same sets, so that differences are paired. References: Efron and
    Tibshirani, An Introduction to the Bootstrap, 1993, section 13.3 (percentile interval). Few
    sets make it too narrow.
    """
    chosen = np.random.default_rng(0).integers(len(values), size=(RESAMPLES, len(values)))
    low, high = np.quantile(values[chosen].mean(axis=1), ENDS)
    return float(values.mean()), float(low), float(high)


def summary(scores: Sequence[Scores], challenge: Challenge) -> dict[str, Any]:
    """The result as JSON takes it: mean and 90 % interval of scores, and of differences."""
    first = scores[0].by_set
    entries = [
        {
            "name": own.name,
            "scores": {key: _interval(values) for key, values in own.by_set.items()},
            "minus_first": {key: _interval(v - first[key]) for key, v in own.by_set.items()},
            "by_set": {key: values.tolist() for key, values in own.by_set.items()},
        }
        for own in scores
    ]
    uniform = -float(np.log(len(challenge.causes)))
    return {
        "challenge": challenge.name,
        "sets": list(challenge.rows),
        "equal_probabilities": uniform,
        "entries": entries,
    }


def _interval(values: Floats) -> dict[str, float]:
    return dict(zip(("mean", "p05", "p95"), bootstrap(values), strict=True))


def score_text(found: dict[str, Any]) -> str:
    """The tables of a summary."""
    entries = found["entries"]
    units = {CAUSES: "causes, ln p"} | {c: c.rpartition("_")[0] for c in COLUMNS}
    header = ["entry", *(units[key] for key in entries[0]["scores"])]
    parts = [
        f"Scores over {len(found['sets'])} sets, mean and 90 % interval: ln p of the right cause "
        f"(higher is better; equal\nprobabilities {found['equal_probabilities']:.2f}), and CRPS of "
        "readings kept back in units of the noise (lower is better).\n",
        format_table(header, [_cells(e["name"], e["scores"]) for e in entries]),
    ]
    if len(entries) > 1:
        parts += [
            f"\nDifferences to {entries[0]['name']}, paired by set.\n",
            format_table(header, [_cells(e["name"], e["minus_first"]) for e in entries[1:]]),
        ]
    return "\n".join(parts)


def _cells(name: str, intervals: dict[str, dict[str, float]]) -> list[str]:
    shown = (f"{v['mean']:.2f} [{v['p05']:.2f}, {v['p95']:.2f}]" for v in intervals.values())
    return [name, *shown]
