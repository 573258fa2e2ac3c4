"""The benchmark's figures and gates, from the records of its sets."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

import gap_enlarged
import gap_families
import gap_held_out
import gap_reliability
import numpy as np
from core_speed import SOLVES
from gap_records import (
    CLAIMING_STATUSES,
    SUSPECT_DESIGNS,
    Figure,
    Judged,
    bare,
    falsely_unique,
    holds,
    nameable,
    own_figures,
    rate,
    right,
    scattered,
    share,
    suspected,
    unique,
)

#: Half width of a 90 % interval in standard deviations.
SIGMAS_90 = 1.645
#: Rows of a set, at most, of the lines on time.
ROW_LIMITS = (24, 48, 72)
#: Distance of the soil alone from the truth, in noise, from which the region is judged: below it,
#: nothing is left to improve.
REGION_GAP = 2.0


def figures(sets: Sequence[Judged]) -> list[Figure]:
    """Every figure of the benchmark with its gate; added sets count in those of their group."""
    every, sets = sets, gap_enlarged.sampled(sets)
    usual = [s for s in sets if not own_figures(s)]
    return [
        *_naming(usual, gap_enlarged.sampled(every, *gap_enlarged.OF_DISCREPANCY)),
        *_false_names(usual),
        *_silence(usual),
        *_suspects(usual, gap_enlarged.sampled(every, gap_enlarged.ONE_LOAD)),
        *gap_families.figures(every),
        *_probabilities(sets),
        *gap_held_out.figures(sets),
        *_region(usual),
        *_soil(usual),
        *_time(sets),
    ]


def named_designs(sets: Sequence[Judged]) -> list[Judged]:
    """Sets whose designs can name a cause, of tiers without figures of their own."""
    return [s for s in sets if s["design"] not in SUSPECT_DESIGNS and not own_figures(s)]


def _naming(sets: Sequence[Judged], enlarged: Sequence[Judged]) -> Iterator[Figure]:
    """Of the sample, and of the sample with what was added at some sizes of discrepancy."""
    own = [s for s in named_designs(enlarged) if nameable(s)]
    for level, goal in ((0.0, ">= 0.95"), (0.01, ">= 0.93"), (0.02, ">= 0.90"), (0.04, ">= 0.85")):
        part = [s for s in own if s["discrepancy"] == level]
        text = f"right cause in the cause set, SNR >= 3, discrepancy {level:.0%}"
        yield share(text, sum(map(holds, part)), len(part), goal)
    alone = [s for s in sets if unique(s)]
    yield share("right when unique, all tiers", sum(map(right, alone)), len(alone), ">= 0.95")
    known = [s for s in alone if s["catalogued"]]
    text = "right when unique, cause in the catalogue"
    yield share(text, sum(map(right, known)), len(known))


def _false_names(sets: Sequence[Judged]) -> Iterator[Figure]:
    groups = {
        "null": [s for s in sets if bare(s) and not scattered(s)],
        "scatter": [s for s in sets if scattered(s)],
        "discrepancy alone": [s for s in sets if s["tier"] == "D"],
        "cause outside the catalogue": [s for s in sets if s["tier"] == "C"],
    }
    for name, own in groups.items():
        yield share(f"falsely unique: {name}", sum(map(falsely_unique, own)), len(own), "<= 0.05")
    for name in ("null", "scatter"):
        own = groups[name]
        hits = sum(s["status"] in CLAIMING_STATUSES for s in own)
        yield share(f"an effect stated, alone or in a class: {name}", hits, len(own))


def _silence(sets: Sequence[Judged]) -> Iterator[Figure]:
    own = [s for s in sets if nameable(s)]
    for status, goal in (("unknown", "<= 0.05"), ("no-gap", "<= 0.02")):
        hits = sum(s["status"] == status for s in own)
        yield share(f"`{status}`, cause in the catalogue, SNR >= 3", hits, len(own), goal)
    hits = sum(s["status"] == "crash" for s in sets)
    yield share("analysis ended by an error", hits, len(sets), "<= 0.0")


def _suspects(sets: Sequence[Judged], enlarged: Sequence[Judged]) -> Iterator[Figure]:
    """Of the sample with what was added at one load, and of the sample."""

    def at_one_load(given: Sequence[Judged]) -> list[Judged]:
        own = (s for s in given if s["design"] in SUSPECT_DESIGNS and not own_figures(s))
        return [s for s in own if s["catalogued"]]

    for most, place, goal in ((1, "first", ">= 0.75"), (3, "in the first three", ">= 0.95")):
        own = [s for s in at_one_load(enlarged) if nameable(s)]
        hits = sum(suspected(s, most) for s in own)
        yield share(f"one load, SNR >= 3: truth {place} among suspects", hits, len(own), goal)
        own = [s for s in at_one_load(sets) if s["signal"] >= 2.0 * 3.0]
        hits = sum(suspected(s, most) for s in own)
        yield share(f"one load, signature of 6 sigma: truth {place}", hits, len(own))


def _probabilities(sets: Sequence[Judged]) -> Iterator[Figure]:
    stated, true = gap_reliability.statements(sets)
    for name, bins, gate in (
        ("bins of 50", gap_reliability.equal_bins(stated, true), ""),
        ("wide bins", gap_reliability.wide_bins(stated, true), "<= 0.05"),
    ):
        worst, (usual, seldom) = gap_reliability.largest(bins), gap_reliability.chance(bins)
        text = f"{worst:.3f}; by chance alone {usual:.3f} (95 %: {seldom:.3f})" if bins else "-"
        met = worst <= 0.05 if bins and gate else None
        yield Figure(f"stated probabilities, largest deviation, {name}", text, gate, met)
    mixed = gap_reliability.at_expected_mix(sets)
    text = f"{gap_reliability.largest(mixed):.3f}" if mixed else "-"
    yield Figure("stated probabilities, the same at the mix that the prior expects", text)
    share_of_exact = gap_reliability.chance_of_as_much(stated, true)
    there = bool(np.isfinite(share_of_exact))
    yield Figure(
        "stated probabilities, share of exact ones that deviate as much in all wide bins",
        f"{share_of_exact:.3f}" if there else "-",
        ">= 0.05",
        share_of_exact >= 0.05 if there else None,
    )
    found, (low, high), (usual, seldom) = gap_reliability.calibration_error(sets)
    there = bool(np.isfinite(found))
    text = f"{found:.3f} ({low:.3f}-{high:.3f}); by chance alone {usual:.3f} (95 %: {seldom:.3f})"
    yield Figure(
        f"stated probabilities from {gap_reliability.NOTABLE:g}, expected calibration error",
        text if there else "-",
        "<= 0.05",
        found <= 0.05 if there else None,
    )


def median_ratio(sets: Sequence[Judged], key: str) -> float:
    """Median over sets of the region's distance to the truth, relative to the soil alone."""
    ratios = [
        s["region"][key] / s["region"]["soil"]
        for s in sets
        if key in s.get("region", {}) and s["region"]["soil"] > REGION_GAP
    ]
    return float(np.median(ratios)) if ratios else float("nan")


def _region(sets: Sequence[Judged]) -> Iterator[Figure]:
    own = [s for s in sets if s["status"] in ("named", "partly-named")]
    ours, process = median_ratio(own, "named"), median_ratio(own, "Gaussian process")
    there = bool(np.isfinite(ours) and np.isfinite(process))
    yield Figure(
        "held-out region, left after / before, named or partly named, median",
        f"{ours:.3f}" if there else "-",
        "<= 0.30",
        ours <= 0.3 if there else None,
    )
    yield Figure(
        "the same over that of a Gaussian process",
        f"{ours / process:.3f}" if there else "-",
        "<= 0.50",
        ours <= 0.5 * process if there else None,
    )


def _soil(sets: Sequence[Judged]) -> Iterator[Figure]:
    """Coverage of 90 % intervals, over all sets but those with a cause outside the catalogue."""
    for level in (0.0, 0.02):
        own = [s for s in sets if s["discrepancy"] == level and s["tier"] != "C" and "soil" in s]
        for name, symbol in (("cohesion", "c"), ("friction_angle", "phi"), ("shear_modulus", "K")):
            values = [s["soil"][name] for s in own if name in s["soil"]]
            hits = sum(abs(v["after"] - v["true"]) <= SIGMAS_90 * v["std"] for v in values)
            share = hits / len(values) if values else float("nan")
            gated = level == 0.02
            yield Figure(
                f"90 % interval of {symbol}: coverage, discrepancy {level:.0%}",
                rate(hits, len(values)),
                "0.86 to 0.94" if gated else "",
                0.86 <= share <= 0.94 if gated and values else None,
            )


def _time(sets: Sequence[Judged]) -> Iterator[Figure]:
    low = 0
    for limit in (*ROW_LIMITS, None):
        own = [
            s["seconds"] * s["solves"] / SOLVES
            for s in sets
            if {"seconds", "solves"} <= s.keys()
            and s["rows"] > low
            and (limit is None or s["rows"] <= limit)
        ]
        if own:
            rows = f"{low + 1} to {limit} rows" if limit else f"more than {low} rows"
            gated = limit == ROW_LIMITS[-1]
            median, most = float(np.median(own)), max(own)
            yield Figure(
                f"seconds of a core of {SOLVES:,} solutions a second, {rows}: median, longest",
                f"{median:.2f}, {most:.1f} ({len(own)} sets)",
                "<= 1, <= 4" if gated else "",
                (median <= 1.0 and most <= 4.0) if gated else None,
            )
        low = limit or low


def confusion(sets: Sequence[Judged]) -> tuple[list[tuple[str, str, int, int]], Counter[str]]:
    """(truth, stated instead, times, of) of nameable causes, and how many there were of each."""
    own = [s for s in named_designs(sets) if nameable(s)]
    total: Counter[str] = Counter("+".join(s["truth"]) for s in own)
    wrong: Counter[tuple[str, str]] = Counter()
    for s in own:
        if not holds(s):
            said = "+".join(s["cause_set"][0]) if s.get("cause_set") else f"`{s['status']}`"
            wrong["+".join(s["truth"]), said] += 1
    cells = [(t, n, k, total[t]) for (t, n), k in wrong.items()]
    return sorted(cells, key=lambda c: (-c[2], c[2] / c[3], c[0])), total
