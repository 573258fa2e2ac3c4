"""The benchmark's figures and gates, from the judged sets."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.stats import beta

Judged = dict[str, Any]
SENSORS = {
    "torque-offset",
    "torque-gain",
    "load-gain",
    "drawbar-offset",
    "drawbar-gain",
    "sinkage-offset",
    "sinkage-gain",
    "slip-scale",
}


def upper(hits: int, count: int) -> float:
    """Upper end of the two-sided 95 % interval of a rate (Clopper and Pearson)."""
    return 1.0 if hits >= count else float(beta.ppf(0.975, hits + 1, count - hits))


def rate(hits: int, count: int) -> str:
    """A rate with its 95 % interval and how many it is of."""
    if count == 0:
        return "-"
    low = 0.0 if hits == 0 else float(beta.ppf(0.025, hits, count - hits + 1))
    return f"{hits / count:.3f} ({low:.3f}-{upper(hits, count):.3f}), {hits}/{count}"


def seen(sets: Sequence[Judged]) -> list[Judged]:
    """Those in which a gap was found that could be spoken about."""
    return [s for s in sets if s["status"] in ("named", "form-open", "class", "unknown")]


def unique(sets: Sequence[Judged]) -> list[Judged]:
    """Those with one cause."""
    return [s for s in sets if len(s["cause_set"]) == 1]


def holds(s: Judged) -> bool:
    """Whether the truth is in the cause set."""
    return s["truth"] in s["cause_set"]


def first(s: Judged) -> bool:
    """Whether the best cause is the truth."""
    return bool(s["cause_set"]) and s["cause_set"][0] == s["truth"]


def twins(truth: Sequence[str], names: Sequence[str]) -> bool:
    """Whether two sets differ in nothing but grousers against a gain of the torque sensor."""
    pair = {"grousers", "torque-gain"}
    return set(truth) - pair == set(names) - pair and len(set(names)) == len(set(truth))


def least(goal: float) -> Callable[[float], bool]:
    """At least so much."""
    return lambda share: share >= goal


def always(share: float) -> bool:
    """No gate."""
    return True


def median_ratio(sets: Sequence[Judged], key: str) -> float:
    """Median over sets of the region's distance to the truth, relative to the soil alone."""
    ratios = [
        s["region"][key] / s["region"]["soil"]
        for s in sets
        if key in s.get("region", {}) and s["region"]["soil"] > 2.0
    ]
    return float(np.median(ratios)) if ratios else float("nan")


def gates(sets: Sequence[Judged], alone: Sequence[float]) -> list[tuple[str, str, str, bool]]:
    """(figure, measured, gate, met) of every gate."""
    rows: list[tuple[str, str, str, bool]] = []

    def gate(name: str, hits: int, count: int, text: str, met: Callable[[float], bool]) -> None:
        share = hits / count if count else float("nan")
        rows.append((name, rate(hits, count), text, bool(met(share))))

    tier = {t: [s for s in sets if s["tier"] == t] for t in {s["tier"] for s in sets}}
    for t in ("N0", "N1", "N2", "N3", "N4"):
        own = tier.get(t, [])
        hits = sum(s["status"] != "no-gap" for s in own)
        goal = "upper bound <= 0.10" if t != "N4" else "-"
        rows.append(
            (
                f"false alarms, {t}",
                rate(hits, len(own)),
                goal,
                t == "N4" or upper(hits, len(own)) <= 0.1,
            )
        )
    own = [s for t in ("N0", "N1", "N2", "N3") for s in tier.get(t, [])]
    hits = sum(s["status"] != "no-gap" for s in own)
    rows.append(
        (
            "false alarms, N0-N3",
            rate(hits, len(own)),
            "upper bound <= 0.10",
            upper(hits, len(own)) <= 0.1,
        )
    )
    ab = seen([*tier.get("A", []), *tier.get("B", [])])
    for noise in (0.01, 0.02, 0.03):
        own = [s for s in ab if s["noise"] == noise]
        gate(
            f"cause set holds the truth, A and B, {noise:.0%} noise",
            sum(map(holds, own)),
            len(own),
            ">= 0.90",
            lambda x: x >= 0.9,
        )
    for t, goal in (("A", 0.93), ("B", 0.90)):
        own = unique(seen(tier.get(t, [])))
        gate(
            f"right when unique, {t}",
            sum(map(first, own)),
            len(own),
            f">= {goal}",
            lambda x, g=goal: x >= g,
        )
    own = [s for s in ab if s["snr"] >= 3.0]
    gate(
        "first is the truth where separating SNR >= 3",
        sum(map(first, own)),
        len(own),
        ">= 0.95",
        lambda x: x >= 0.95,
    )
    for noise in (0.01, 0.02, 0.03):
        own = [s for s in tier.get("C", []) if s["noise"] == noise]
        hits = sum(len(s["cause_set"]) == 1 and s["status"] in ("named", "form-open") for s in own)
        gate(
            f"open set: falsely unique, {noise:.0%} noise",
            hits,
            len(own),
            "<= 0.05" if noise == 0.01 else "-",
            lambda x, n=noise: n > 0.01 or x <= 0.05,
        )
    own = tier.get("S", [])
    hits = sum(
        s["status"] in ("named", "form-open")
        and not any(SENSORS & set(c) for c in s["cause_set"])
        and bool(s["cause_set"])
        for s in own
    )
    gate("physics named alone on sensor-bias data", hits, len(own), "<= 0.05", lambda x: x <= 0.05)
    own = [s for s in tier.get("M", []) if s["noise"] == 0.01 and "grousers" not in s["truth"]]
    hits = sum(s["cause_set"] == [s["truth"]] for s in own)
    gate("two separable effects, exactly right, 1 % noise", hits, len(own), ">= 0.90", least(0.9))
    own = [s for s in tier.get("M", []) if s["noise"] == 0.01 and "grousers" in s["truth"]]
    hits = sum(holds(s) and all(twins(s["truth"], names) for names in s["cause_set"]) for s in own)
    gate(
        "two effects, one of them grousers: right but for torque-gain", hits, len(own), "-", always
    )
    named = [
        s for s in tier.get("A", []) + tier.get("B", []) if s["status"] in ("named", "form-open")
    ]
    ours, process = median_ratio(named, "named"), median_ratio(named, "Gaussian process")
    rows.append(
        (
            "held-out region, distance left, named / soil alone (median)",
            f"{ours:.3f}",
            "<= 0.25",
            ours <= 0.25,
        )
    )
    rows.append(
        (
            "the same, relative to the Gaussian process",
            f"{ours / process:.3f}",
            "<= 0.5",
            ours <= 0.5 * process,
        )
    )
    seconds, slow = float(np.median(alone)), float(np.quantile(alone, 0.95))
    rows.append(
        (
            "one analysis, seconds of one core, median (95 %)",
            f"{seconds:.2f} ({slow:.2f})",
            "<= 1",
            seconds <= 1.0,
        )
    )
    return rows


def confusion(sets: Sequence[Judged]) -> tuple[list[tuple[str, str, int, int]], Counter[str]]:
    """(truth, named instead, times, of) of the weakest cells, and how often each was right."""
    own = seen([s for s in sets if s["tier"] in ("A", "B")])
    total: Counter[str] = Counter("+".join(s["truth"]) for s in own)
    wrong: Counter[tuple[str, str]] = Counter()
    for s in own:
        if not holds(s):
            said = "+".join(s["cause_set"][0]) if s["cause_set"] else s["status"]
            wrong["+".join(s["truth"]), said] += 1
    cells = [(t, n, k, total[t]) for (t, n), k in wrong.items()]
    return sorted(cells, key=lambda c: (-c[2] / c[3], -c[2])), total
