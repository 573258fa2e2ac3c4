"""Questions about the record of one blind set, and rates of their answers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from scipy.stats import beta

Judged = dict[str, Any]

#: Statuses that state exactly one explanation where the cause set has one member.
UNIQUE_STATUSES = ("named", "partly-named", "form-open")
#: Statuses that state an explanation.
CLAIMING_STATUSES = (*UNIQUE_STATUSES, "class")
#: Designs that leave suspects, not names: they are judged by those.
FEW_ROWS = "few-rows"
SUSPECT_DESIGNS = ("one-load", "one-run", "jittered-one-load", FEW_ROWS)
#: Tiers and designs with figures of their own, which the others do not count.
LATER_TIERS, LATER_DESIGNS = ("L", "T"), (FEW_ROWS, "torque-alone")
#: Separation, in sigma, from which an effect can be named.
NAMEABLE_SIGMA = 3.0


@dataclass(frozen=True)
class Figure:
    """A line of the table; `met` is None where there is no gate or nothing was measured."""

    name: str
    measured: str
    gate: str = ""
    met: bool | None = None


def share(name: str, hits: int, count: int, gate: str = "") -> Figure:
    """A rate with a gate such as '>= 0.95'."""
    met = reaches(hits / count, gate) if gate and count else None
    return Figure(name, rate(hits, count), gate, met)


def reaches(value: float, gate: str) -> bool:
    """Whether a value is on the right side of a gate such as '<= 0.5'."""
    relation, goal = gate.split()
    return value >= float(goal) if relation == ">=" else value <= float(goal)


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table in Markdown."""
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    return "\n".join([*lines, *["| " + " | ".join(row) + " |" for row in rows]]) + "\n"


def own_figures(s: Judged) -> bool:
    """Whether a set has figures of its own, which the others do not count."""
    return s["tier"] in LATER_TIERS or s["design"] in LATER_DESIGNS


def unique(s: Judged) -> bool:
    """Whether the report states one explanation and no other."""
    return s["status"] in UNIQUE_STATUSES and len(s.get("cause_set", ())) == 1


def holds(s: Judged) -> bool:
    """Whether the truth is in the cause set."""
    return s["truth"] in s.get("cause_set", ())


def first(s: Judged) -> bool:
    """Whether the best explanation is the truth."""
    return bool(s.get("cause_set")) and s["cause_set"][0] == s["truth"]


def right(s: Judged) -> bool:
    """Whether every effect of the best explanation is one that was hidden, or right too."""
    return bool(s.get("cause_set")) and set(s["cause_set"][0]) <= answers(s)


def answers(s: Judged) -> set[str]:
    """The effects that were hidden, and those that are right too where another law was."""
    return {*s["truth"], *s.get("relatives", ())}


def falsely_unique(s: Judged) -> bool:
    """Whether one explanation is stated that is neither right nor of the right family."""
    return unique(s) and not right(s)


def suspected(s: Judged, most: int) -> bool:
    """Whether the truth is among so many first suspects, or claimed explanations without them."""
    return s["truth"] in (s.get("suspects") or s.get("cause_set") or ())[:most]


def related(s: Judged) -> bool:
    """Whether the likeliest explanation has an effect of the truth, or of its family."""
    likeliest = (s.get("cause_set") or s.get("suspects") or ((),))[0]
    return bool(answers(s) & set(likeliest))


def nameable(s: Judged) -> bool:
    """Whether the catalogue has the cause, and the runs separate it from everything else."""
    return bool(s["catalogued"] and s["snr"] >= NAMEABLE_SIGMA)


def bare(s: Judged) -> bool:
    """Whether nothing is hidden and the world follows the model, but for scatter and noise."""
    return bool(s["tier"].startswith("N"))


def scattered(s: Judged) -> bool:
    """Whether the soil differs from run to run, with nothing hidden."""
    return s["tier"] == "N1" or (bare(s) and s["design"] == "unequal-soils")


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


def from_json(records: Sequence[Judged]) -> list[Judged]:
    """Records as they were before they were written: sets of names are tuples."""
    return [
        s
        | {"truth": tuple(s["truth"])}
        | {key: [tuple(names) for names in s[key]] for key in ("cause_set", "suspects") if key in s}
        for s in records
    ]
