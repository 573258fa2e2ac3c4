"""The figures and gates of the gap benchmark, from the records of its sets."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import gap_reliability
import numpy as np
from core_speed import SOLVES
from scipy.stats import beta

Judged = dict[str, Any]

#: Statuses that state exactly one explanation where the cause set has one member.
UNIQUE_STATUSES = ("named", "partly-named", "form-open")
#: Designs that leave suspects, not names: they are judged by those.
FEW_ROWS = "few-rows"
SUSPECT_DESIGNS = ("one-load", "one-run", "jittered-one-load", FEW_ROWS)
#: Tiers and designs with figures of their own, which the others do not count.
LATER_TIERS, LATER_DESIGNS = ("L", "T"), (FEW_ROWS, "torque-alone")
#: Separation, in sigma, from which an effect can be named; signature from which a set shows that
#: something is missing.
NAMEABLE_SIGMA, VISIBLE_SIGMA = 3.0, 6.0
#: Half width of a 90 % interval in standard deviations.
SIGMAS_90 = 1.645
#: Rows of the sets that are timed, and the gates of their median and longest, s.
TIMED_ROWS, MEDIAN_TIME, LONGEST_TIME = (49, 72), 1.0, 4.0
#: Distance of the soil alone from the truth, in noise, from which a prediction and the heavier
#: loads are judged: below it, nothing is left to improve.
LEFT, REGION_GAP = 1.0, 2.0
#: Ratio that counts as worse than the soil alone, and growth that counts: beyond rounding.
WORSE, GREW = 1.05, 1.0 + 1e-9
#: Groups of plans that are enlarged by sets beside the sample, with what belongs to each. All its
#: sets with a cause that can be named are alike to the figures that use it, and no other figure
#: counts those that were added.
SMALL, LARGE, ONE_LOAD = "discrepancy 1%", "discrepancy 4%", "one load"
CATALOGUED_TIERS = ("A", "B", "S", "M")
GROUPS: Mapping[str, Callable[[Judged], bool]] = {
    SMALL: lambda p: p["discrepancy"] == 0.01 and p["design"] not in SUSPECT_DESIGNS,
    LARGE: lambda p: p["discrepancy"] == 0.04 and p["design"] not in SUSPECT_DESIGNS,
    ONE_LOAD: lambda p: p["design"] in SUSPECT_DESIGNS and p["design"] not in LATER_DESIGNS,
    FEW_ROWS: lambda p: p["design"] == FEW_ROWS,
}


@dataclass(frozen=True)
class Figure:
    """A line of the table; `met` is None where there is no gate or nothing was measured."""

    name: str
    measured: str
    gate: str = ""
    met: bool | None = None


def share(
    name: str, sets: Sequence[Judged], hit: Callable[[Judged], bool], gate: str = ""
) -> Figure:
    """The rate of hits among some sets, with a gate such as '>= 0.95'."""
    hits = sum(map(hit, sets))
    met = reaches(hits / len(sets), gate) if gate and sets else None
    return Figure(name, rate(hits, len(sets)), gate, met)


def number(name: str, value: float, text: str, gate: str = "") -> Figure:
    """A figure that is a number; NaN where nothing was measured."""
    there = bool(np.isfinite(value))
    met = reaches(value, gate) if gate and there else None
    return Figure(name, text if there else "-", gate, met)


def reaches(value: float, gate: str) -> bool:
    """Whether a value is on the right side of a gate such as '<= 0.5'."""
    relation, goal = gate.split()
    return value >= float(goal) if relation == ">=" else value <= float(goal)


def interval(hits: int, count: int) -> tuple[float, float]:
    """Two-sided 95 % interval of a rate (Clopper and Pearson)."""
    low = 0.0 if hits == 0 else float(beta.ppf(0.025, hits, count - hits + 1))
    return low, 1.0 if hits >= count else float(beta.ppf(0.975, hits + 1, count - hits))


def rate(hits: int, count: int) -> str:
    """A rate with its 95 % interval and how many it is of."""
    if count == 0:
        return "-"
    low, high = interval(hits, count)
    return f"{hits / count:.3f} ({low:.3f}-{high:.3f}), {hits}/{count}"


# Questions about one record ------------------------------------------------------------------


def own_figures(s: Judged) -> bool:
    """Whether a set has figures of its own, which the others do not count."""
    return s["tier"] in LATER_TIERS or s["design"] in LATER_DESIGNS


def unique(s: Judged) -> bool:
    """Whether the report states one explanation and no other."""
    return s["status"] in UNIQUE_STATUSES and len(s.get("cause_set", ())) == 1


def holds(s: Judged) -> bool:
    """Whether the truth is in the cause set."""
    return s["truth"] in s.get("cause_set", ())


def answers(s: Judged) -> set[str]:
    """The effects that were hidden, and those that are right too where another law was."""
    return {*s["truth"], *s.get("relatives", ())}


def right(s: Judged) -> bool:
    """Whether every effect of the best explanation is one that was hidden, or right too."""
    return bool(s.get("cause_set")) and set(s["cause_set"][0]) <= answers(s)


def falsely_unique(s: Judged) -> bool:
    """Whether one explanation is stated that is neither right nor of the right family."""
    return unique(s) and not right(s)


def suspected(most: int) -> Callable[[Judged], bool]:
    """Whether the truth is among so many first suspects, or claimed explanations without them."""
    return lambda s: s["truth"] in (s.get("suspects") or s.get("cause_set") or ())[:most]


def related(s: Judged) -> bool:
    """Whether the likeliest explanation has an effect of the truth, or of its family."""
    likeliest = (s.get("cause_set") or s.get("suspects") or ((),))[0]
    return bool(answers(s) & set(likeliest))


def nameable(s: Judged) -> bool:
    """Whether the catalogue has the cause, and the runs separate it from everything else."""
    return bool(s["catalogued"] and s["snr"] >= NAMEABLE_SIGMA)


def visible(s: Judged) -> bool:
    """Whether the signature of the cause is far beyond the noise."""
    return bool(s["signal"] >= VISIBLE_SIGMA)


def bare(s: Judged) -> bool:
    """Whether nothing is hidden and the world follows the model, but for scatter and noise."""
    return bool(s["tier"].startswith("N"))


def scattered(s: Judged) -> bool:
    """Whether the soil differs from run to run, with nothing hidden."""
    return s["tier"] == "N1" or (bare(s) and s["design"] == "unequal-soils")


# Selections ----------------------------------------------------------------------------------


def sampled(sets: Sequence[Judged], *groups: str) -> list[Judged]:
    """The sets of the sample, and those that were added to some groups."""
    return [s for s in sets if s.get("added_to", "") in ("", *groups)]


def named_designs(sets: Sequence[Judged]) -> list[Judged]:
    """Sets whose designs can name a cause, of tiers without figures of their own."""
    return [s for s in sets if s["design"] not in SUSPECT_DESIGNS and not own_figures(s)]


def tier(sets: Sequence[Judged], *names: str) -> list[Judged]:
    """Sets of tiers, but those of designs with figures of their own."""
    return [s for name in names for s in sets if s["tier"] == name and s["design"] == "sweep"]


# Figures -------------------------------------------------------------------------------------


def figures(every: Sequence[Judged]) -> list[Figure]:
    """Every figure of the benchmark with its gate; added sets count in those of their group."""
    sets = sampled(every)
    usual = [s for s in sets if not own_figures(s)]
    return [
        *_naming(usual, sampled(every, SMALL, LARGE)),
        *_false_names(usual),
        *_silence(usual),
        *_suspects(sampled(every, ONE_LOAD)),
        *_families(sets),
        *_few_rows(sampled(every, FEW_ROWS)),
        *_torque_alone(sets),
        *_probabilities(sets),
        *_held_out(sets),
        *_region(usual),
        *_pull(usual),
        *_soil(usual),
        *_time(sets),
    ]


def _naming(sets: Sequence[Judged], enlarged: Sequence[Judged]) -> Iterator[Figure]:
    """Of the sample, and of the sample with what was added at some sizes of discrepancy."""
    own = [s for s in named_designs(enlarged) if nameable(s)]
    for level, goal in ((0.0, ">= 0.95"), (0.01, ">= 0.93"), (0.02, ">= 0.90"), (0.04, ">= 0.85")):
        part = [s for s in own if s["discrepancy"] == level]
        name = f"right cause in the cause set, SNR >= 3, discrepancy {level:.0%}"
        yield share(name, part, holds, goal)
    alone = [s for s in sets if unique(s)]
    yield share("right when unique, all tiers", alone, right, ">= 0.95")


def _false_names(sets: Sequence[Judged]) -> Iterator[Figure]:
    null = [s for s in sets if bare(s) and not scattered(s)]
    scatter = [s for s in sets if scattered(s)]
    for name, own in (
        ("null", null),
        ("scatter", scatter),
        ("discrepancy alone", [s for s in sets if s["tier"] == "D"]),
        ("cause outside the catalogue", [s for s in sets if s["tier"] == "C"]),
    ):
        yield share(f"falsely unique: {name}", own, falsely_unique, "<= 0.05")


def _silence(sets: Sequence[Judged]) -> Iterator[Figure]:
    own = [s for s in sets if nameable(s)]
    for status, goal in (("unknown", "<= 0.05"), ("no-gap", "<= 0.02")):
        name = f"`{status}`, cause in the catalogue, SNR >= 3"
        yield share(name, own, lambda s, said=status: s["status"] == said, goal)
    yield share("analysis ended by an error", sets, lambda s: s["status"] == "crash", "<= 0.0")


def _suspects(sets: Sequence[Judged]) -> Iterator[Figure]:
    """Of the sample with what was added at one load."""
    own = (s for s in sets if s["design"] in SUSPECT_DESIGNS and not own_figures(s))
    one_load = [s for s in own if s["catalogued"] and nameable(s)]
    for most, place, goal in ((1, "first", ">= 0.75"), (3, "in the first three", ">= 0.95")):
        name = f"one load, SNR >= 3: truth {place} among suspects"
        yield share(name, one_load, suspected(most), goal)


def _families(sets: Sequence[Judged]) -> Iterator[Figure]:
    """Other laws of the soil, and soils that change."""
    own = [s for s in tier(sets, "L") if s["snr"] >= NAMEABLE_SIGMA]
    yield share("a law differs, SNR >= 3: right family first", own, related, ">= 0.80")
    own = [s for s in tier(sets, "T") if visible(s)]
    yield share("soil changes, signature of 6 sigma: change is first", own, related)
    for names, words in (("L", "another law"), ("T", "soil that changes"), ("LTC", "")):
        words = words or "tiers L, T and C"
        yield share(f"falsely unique: {words}", tier(sets, *names), falsely_unique, "<= 0.03")


def _few_rows(sets: Sequence[Judged]) -> Iterator[Figure]:
    few = [s for s in sets if s["design"] == FEW_ROWS and s["catalogued"]]
    own = [s for s in few if nameable(s)]
    for most, place, goal in ((1, "first", ">= 0.70"), (3, "in the first three", ">= 0.90")):
        name = f"5 to 10 rows at one load, SNR >= 3: truth {place}"
        yield share(name, own, suspected(most), goal)


def _torque_alone(sets: Sequence[Judged]) -> Iterator[Figure]:
    own = [s for s in sets if s["design"] == "torque-alone"]
    name = "torque alone, signature of 6 sigma: `no-gap`"
    yield share(name, [s for s in own if visible(s)], lambda s: s["status"] == "no-gap")
    yield share("torque alone: falsely unique", own, falsely_unique, "<= 0.05")


def _probabilities(sets: Sequence[Judged]) -> Iterator[Figure]:
    found, by_chance = gap_reliability.calibration_error(sets)
    name = f"stated probabilities from {gap_reliability.NOTABLE:g}, expected calibration error"
    yield number(name, found, f"{found:.3f}; by chance up to {by_chance:.3f}", "<= 0.05")


def ratios(sets: Sequence[Judged], part: str, over: str, of: str = "named") -> np.ndarray:
    """(n,) distance of a model to the truth over that of a method, where a gap is."""
    own = [s[part] for s in sets if over in s.get(part, {}) and s[part]["soil"] > LEFT]
    return np.asarray([at[of] / at[over] for at in own if of in at])


def _held_out(sets: Sequence[Judged]) -> Iterator[Figure]:
    shown = [pair for s in sets for pair in s.get("gap", {}).values()]
    name = "figures that grow while shown as reduction"
    yield share(name, shown, lambda pair: pair[1] > GREW * pair[0], "<= 0.0")

    def figure(name: str, values: np.ndarray, gate: str = "", of: Any = np.median) -> Figure:
        # as shown; values of a model file are rounded too
        found = round(float(of(values)), 3) if len(values) else float("nan")
        return number(name, found, f"{found:.3f} ({len(values)} sets)", gate)

    def worse(name: str, values: np.ndarray) -> Figure:
        return share(f"{name}, worse than the soil alone by 5 %", values, lambda r: r > WORSE)

    of_soil, model = ratios(sets, "between", "soil"), "returned model over soil alone"
    yield figure(f"held out between, {model}: median", of_soil, "<= 0.50")
    yield figure(f"held out between, {model}: worst set", of_soil, "<= 1.0", np.max)
    yield worse("held out between", of_soil)
    for level in (0.0, 0.02, 0.04):
        at = [s for s in sets if s["discrepancy"] == level]
        name = f"held out between, over a Gaussian process alone, discrepancy {level:.0%}: median"
        yield figure(name, ratios(at, "between", "process of readings"), "<= 1.0")
    heavy = ratios(sets, "region", "soil")
    yield figure(f"heavier loads, {model}: median", heavy)
    yield worse("heavier loads", heavy)


def _region(sets: Sequence[Judged]) -> Iterator[Figure]:
    """Median over sets of the heavier loads' distance to the truth, over that of the soil alone."""
    own = [s["region"] for s in sets if s["status"] in ("named", "partly-named") and "region" in s]
    own = [at for at in own if at["soil"] > REGION_GAP]
    left, process = (
        float(np.median([at[key] / at["soil"] for at in own])) if own else float("nan")
        for key in ("named", "Gaussian process")
    )
    name = "held-out region, left after / before, named or partly named, median"
    yield number(name, left, f"{left:.3f}", "<= 0.30")
    over = left / process
    yield number("the same over that of a Gaussian process", over, f"{over:.3f}", "<= 0.50")


def _pull(sets: Sequence[Judged]) -> Iterator[Figure]:
    """Coverage of bands of pull by the returned model, by place."""
    for place in ("inside", "lighter", "heavier", "faster"):
        own = [s["pull"][place] for s in sets if place in s.get("pull", {})]
        if own:
            text = f"{np.mean(own):.3f}, least {min(own):.2f} ({len(own)} sets)"
            yield Figure(f"90 % bands of pull, {place}: coverage", text)


def _soil(sets: Sequence[Judged]) -> Iterator[Figure]:
    """Coverage of 90 % intervals, over all sets but those with a cause outside the catalogue."""
    for level in (0.0, 0.02):
        own = [s for s in sets if s["discrepancy"] == level and s["tier"] != "C" and "soil" in s]
        for name, symbol in (("cohesion", "c"), ("friction_angle", "phi"), ("shear_modulus", "K")):
            values = [s["soil"][name] for s in own if name in s["soil"]]
            hits = sum(abs(v["after"] - v["true"]) <= SIGMAS_90 * v["std"] for v in values)
            gated = level == 0.02
            yield Figure(
                f"90 % interval of {symbol}: coverage, discrepancy {level:.0%}",
                rate(hits, len(values)),
                "0.86 to 0.94" if gated else "",
                0.86 <= hits / len(values) <= 0.94 if gated and values else None,
            )


def _time(sets: Sequence[Judged]) -> Iterator[Figure]:
    low, high = TIMED_ROWS
    timed = [s for s in sets if "solves" in s and low <= s["rows"] <= high]
    own = [s["seconds"] * s["solves"] / SOLVES for s in timed]
    if own:
        median, most = float(np.median(own)), max(own)
        name = f"seconds of a core of {SOLVES:,} solutions a second, {low} to {high} rows"
        text = f"{median:.2f}, {most:.1f} ({len(own)} sets)"
        met = median <= MEDIAN_TIME and most <= LONGEST_TIME
        gate = f"<= {MEDIAN_TIME:g}, <= {LONGEST_TIME:g}"
        yield Figure(f"{name}: median, longest", text, gate, met)
