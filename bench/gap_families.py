"""Figures of other laws of the soil, of soils that change, of few rows and of torque alone."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from gap_enlarged import sampled
from gap_records import (
    FEW_ROWS,
    NAMEABLE_SIGMA,
    Figure,
    Judged,
    falsely_unique,
    nameable,
    rate,
    related,
    share,
    suspected,
    table,
)

#: Signature, in sigma, from which a set shows that something is missing.
VISIBLE_SIGMA = 6.0


def figures(every: Sequence[Judged]) -> Iterator[Figure]:
    """The figures with their gates; sets that were added count where few rows can name a cause."""
    sets = sampled(every)
    laws, trends = _tier(sets, "L"), _tier(sets, "T")
    own = [s for s in laws if s["snr"] >= NAMEABLE_SIGMA]
    yield share(
        "a law differs, SNR >= 3: right family first", sum(map(related, own)), len(own), ">= 0.80"
    )
    own = [s for s in trends if s["signal"] >= VISIBLE_SIGMA]
    told = sum(related(s) for s in own)
    yield share("soil changes, signature of 6 sigma: change is first", told, len(own))
    for tier, words in (("L", "another law"), ("T", "soil that changes")):
        own = _tier(sets, tier)
        yield share(f"falsely unique: {words}", sum(map(falsely_unique, own)), len(own), "<= 0.03")
    own = [s for tier in "LTC" for s in _tier(sets, tier)]
    yield share(
        "falsely unique: tiers L, T and C", sum(map(falsely_unique, own)), len(own), "<= 0.03"
    )
    few = [s for s in sampled(every, FEW_ROWS) if s["design"] == FEW_ROWS and s["catalogued"]]
    own = [s for s in few if nameable(s)]
    for most, place, goal in ((1, "first", ">= 0.70"), (3, "in the first three", ">= 0.90")):
        hits = sum(suspected(s, most) for s in own)
        yield share(f"5 to 10 rows at one load, SNR >= 3: truth {place}", hits, len(own), goal)
        plain = [s for s in sampled(few) if s["signal"] >= VISIBLE_SIGMA]
        hits = sum(suspected(s, most) for s in plain)
        yield share(f"5 to 10 rows, signature of 6 sigma: truth {place}", hits, len(plain))
    own = [s for s in sets if s["design"] == "torque-alone" and s["signal"] >= VISIBLE_SIGMA]
    silent = sum(s["status"] == "no-gap" for s in own)
    yield share("torque alone, signature of 6 sigma: `no-gap`", silent, len(own))
    own = [s for s in sets if s["design"] == "torque-alone"]
    yield share("torque alone: falsely unique", sum(map(falsely_unique, own)), len(own), "<= 0.05")


def _tier(sets: Sequence[Judged], tier: str) -> list[Judged]:
    """Sets of a tier, but those of designs with figures of their own."""
    return [s for s in sets if s["tier"] == tier and s["design"] == "sweep"]


def text(sets: Sequence[Judged]) -> str:
    """What was said of each law and each change."""
    rows = []
    for tier in "LT":
        own = _tier(sets, tier)
        for cause in sorted({s["cause"] for s in own}):
            part = [s for s in own if s["cause"] == cause]
            clear = [s for s in part if s["snr"] >= NAMEABLE_SIGMA]
            seen = [s for s in part if s["signal"] >= VISIBLE_SIGMA]
            rows.append(
                (
                    cause,
                    str(len(part)),
                    rate(sum(map(related, clear)), len(clear)),
                    rate(sum(map(related, seen)), len(seen)),
                    str(sum(map(falsely_unique, part))),
                )
            )
    if not rows:
        return ""
    return (
        "## Other laws, and soils that change\n\nThe likeliest explanation is the law or another "
        "of its family, or a drift of what changes in the soil.\n\n"
        + table(
            ("hidden", "sets", "first, SNR >= 3", "first, signature of 6 sigma", "falsely unique"),
            rows,
        )
    )
