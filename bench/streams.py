"""A day of driving: the tracker beside plain steps, `python bench/run.py streams`.

`python bench/streams.py [DAYS [WORLD...]]` prints coverage and flags of the tracker over many days,
with standard errors.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np
from benchmarks_file import ROOT
from driven_days import SLIP_STD, TORQUE_NOISE, Day, Floats, Kind, simulate_day

from soilml import Estimator, SoilTracker
from soilml.io.text_tables import format_table
from soilml.onboard.estimate import Estimate
from soilml.onboard.tracking import Event

#: Days of each line, of a table of many days, and the first seed. Limits of the tracker were chosen
#: on days of other seeds.
DAYS, MANY_DAYS, SEED = 12, 100, 100
#: Rows after a change from which the soil counts as steady.
SETTLED = 20
#: A soil that changed is found if the tracker says so within so many rows.
WITHIN = 40
#: Sizes of a change, as rms relative change of torque, by which delays are listed.
SIZES = (0.0, 0.1, 0.2, np.inf)
#: Lines of the table: mechanism that the files do not model, its size, and size of usual errors.
WORLDS = (
    ("as modelled", "", 0.0, 0.0),
    ("slip-sinkage 0.3", "slip-sinkage", 0.3, 0.0),
    ("grousers of 10 mm", "grousers", 0.01, 0.0),
    ("all typical errors", "", 0.0, 1.0),
)
#: Those of the table of many days: a right model, and errors as the averaged answer expects them.
LONG_WORLDS = ("as modelled", "all typical errors")
#: Deviation in standard deviations of a soil that the estimate is wrong about.
FAR = 3.0


@dataclass
class Tally:
    """What happened in days of one world."""

    covered: list[Floats] = field(default_factory=list)
    widths: list[Floats] = field(default_factory=list)  # standard deviations over the prior's
    answered: list[bool] = field(default_factory=list)
    delays: list[tuple[float, float]] = field(default_factory=list)  # size and rows
    false_alarms: list[bool] = field(default_factory=list)
    glitches: list[bool] = field(default_factory=list)
    stuck: list[bool] = field(default_factory=list)
    slip_stuck: list[float] = field(default_factory=list)  # rows until each is set aside
    paused: list[bool] = field(default_factory=list)
    drifts: list[float] = field(default_factory=list)  # rows until flagged
    far: list[bool] = field(default_factory=list)  # of rows far off in a drift: whether flagged


def tracked(estimator: Estimator, days: Sequence[Day]) -> Tally:
    """The days as the tracker follows them."""
    tally = Tally()
    for day in days:
        tracker = SoilTracker(estimator)
        states = [tracker.read(**day.row(i)) for i in range(len(day.kinds))]
        events = [state.event for state in states]
        used = [event is Event.ACCEPTED for event in events]
        _add_coverage(tally, day, [state.estimate for state in states], used)
        told = [i for i, e in enumerate(events) if e in (Event.SOIL_CHANGED, Event.DRIFT)]
        for row, size in day.changes:
            delay = next((i - row + 1.0 for i in told if row <= i < row + WITHIN), np.inf)
            tally.delays.append((size, delay))
        for i, (kind, event) in enumerate(zip(day.kinds, events, strict=True)):
            alarm = event in (Event.SOIL_CHANGED, Event.DRIFT, Event.SET_ASIDE, Event.STUCK)
            unchanged = i < day.changes[0][0] or _rows_after_change(day, i) >= WITHIN
            if kind is Kind.SOUND and unchanged:
                tally.false_alarms.append(alarm)
            elif kind is Kind.GLITCH:
                tally.glitches.append(event in (Event.SET_ASIDE, Event.UNUSABLE))
            elif kind is Kind.STUCK:
                tally.stuck.append(event in (Event.STUCK, Event.SET_ASIDE))
            elif kind is Kind.PAUSED:
                tally.paused.append(event in (Event.REPEATED, Event.UNUSABLE))
        tally.slip_stuck.append(_rows_used(day, events))
        begin = day.kinds.index(Kind.DRIFTING)
        tally.drifts.append(next((i - begin + 1.0 for i in told if i >= begin), np.inf))
        flags = [state.drifting or state.rows_in_question > 0 for state in states]
        _add_far(tally, day, [state.estimate for state in states], flags)
    return tally


def stepped(estimator: Estimator, days: Sequence[Day]) -> Tally:
    """The same days with `Estimator.step`, whose only alarm is `in_range`."""
    tally = Tally()
    for day in days:
        memory, estimates = estimator.start(), []
        for i in range(len(day.kinds)):
            found, memory = estimator.step(memory, **day.row(i))
            estimates.append(found)
        _add_coverage(tally, day, estimates, [True] * len(estimates))
        flags = [not found.in_range for found in estimates]
        tally.false_alarms += flags[: day.changes[0][0]]
        _add_far(tally, day, estimates, flags)
    return tally


def _rows_after_change(day: Day, row: int) -> int:
    return row - max([0, *(first for first, _ in day.changes if first <= row)])


def _rows_used(day: Day, events: Sequence[Event]) -> float:
    """Rows of a stuck slip up to the last that is used; a later one counts as never set aside."""
    rows = [i for i, kind in enumerate(day.kinds) if kind is Kind.SLIP_STUCK]
    used = [j + 1.0 for j, i in enumerate(rows) if events[i] is Event.ACCEPTED]
    return max(used, default=0.0)


def _add_coverage(
    tally: Tally, day: Day, estimates: Sequence[Estimate], used: Sequence[bool]
) -> None:
    """Of steady rows: whether the intervals hold, and of used ones, whether they are in range."""
    for i, (kind, found) in enumerate(zip(day.kinds, estimates, strict=True)):
        if kind is Kind.SOUND and _rows_after_change(day, i) >= SETTLED:
            soil = day.soils[i]
            tally.covered.append((found.low <= soil) & (soil <= found.high))
            tally.widths.append(found.std / found.prior_std)
            tally.answered += [bool(found.in_range)] if used[i] else []


def _add_far(tally: Tally, day: Day, estimates: Sequence[Estimate], flags: Sequence[bool]) -> None:
    """Of rows in a drift whose estimate is far from the soil: whether that was flagged."""
    for i, (kind, found) in enumerate(zip(day.kinds, estimates, strict=True)):
        if kind is Kind.DRIFTING and np.any(np.abs(found.mean - day.soils[i]) > FAR * found.std):
            tally.far.append(flags[i])


def _percent(values: Sequence[bool]) -> str:
    return f"{np.mean(values):.0%}" if values else "-"


def _rows(delays: Sequence[float]) -> str:
    """Share found, median and largest delay of those."""
    found = [delay for delay in delays if np.isfinite(delay)]
    if not found:
        return f"0 of {len(delays)}"
    return f"{len(found)} of {len(delays)}; {np.median(found):.0f}, {max(found):.0f}"


def _line(name: str, tally: Tally) -> str:
    covered = np.mean(tally.covered, axis=0)
    of_size = [
        _rows([rows for size, rows in tally.delays if low <= size < high])
        for low, high in pairwise(SIZES)
    ]
    cells = [
        name,
        " / ".join(f"{share:.0%}" for share in covered),
        " / ".join(f"{width:.2f}" for width in np.median(tally.widths, axis=0)),
        _percent(tally.answered),
        f"{1000 * np.mean(tally.false_alarms):.1f}",
        *(of_size if tally.delays else ["-"] * len(of_size)),
        _percent(tally.glitches),
        _percent(tally.stuck),
        f"{max(tally.slip_stuck):.0f}" if tally.slip_stuck else "-",
        _percent(tally.paused),
        _rows(tally.drifts) if tally.drifts else "-",
        f"{_percent(tally.far)} of {len(tally.far)}",
    ]
    return f"| {' | '.join(cells)} |"


def _driven(days: int, mechanism: str, size: float, errors: float) -> list[Day]:
    return [
        simulate_day(seed, ("friction", "zero")[seed % 2], mechanism, size, errors)
        for seed in range(SEED, SEED + days)
    ]


def table(file: Path, days: int = DAYS) -> str:
    """The table of its page."""
    noise = {"slip": (SLIP_STD, 0.0), "torque": (0.0, TORQUE_NOISE)}
    estimator = Estimator.load(file).on(noise=noise, model_error=0.0)
    averaged = Estimator.load(file).on(noise=noise)
    edges = ("below 10 %", "10 to 20 %", "above 20 %")
    heads = (
        "world and method",
        "coverage of 90 % intervals: c / phi / K",
        "width",
        "in range",
        "alarms per 1000 rows",
        *(f"change {edge}" for edge in edges),
        "glitches set aside",
        "torque stuck",
        "slip stuck, rows used",
        "pause",
        "drift",
        f"flagged beyond {FAR:g} std",
    )
    lines = [f"| {' | '.join(heads)} |", "|---|" + "---:|" * (len(heads) - 1)]
    for name, mechanism, size, errors in WORLDS:
        driven = _driven(days, mechanism, size, errors)
        lines.append(_line(f"{name}, tracker, `model_error` 0", tracked(estimator, driven)))
        lines.append(_line(f"{name}, tracker, averaged", tracked(averaged, driven)))
        lines.append(_line(f"{name}, `step`, `model_error` 0", stepped(estimator, driven)))
        lines.append(_line(f"{name}, `step`, averaged", stepped(averaged, driven)))
    return "\n".join(lines)


def table_of_many_days(file: Path, days: int, worlds: Sequence[str] = LONG_WORLDS) -> str:
    """Coverage and flags of the averaged answer, with standard errors over days."""
    noise = {"slip": (SLIP_STD, 0.0), "torque": (0.0, TORQUE_NOISE)}
    averaged = Estimator.load(file).on(noise=noise)
    heads = "many days", "days", "c", "phi", "K", "in range", "alarms", "slip stuck", "torque stuck"
    lines = []
    for name, *world in WORLDS:
        if name in worlds:
            tallies = []
            for day in _driven(days, *world):
                tallies.append(tracked(averaged, [day]))
                print(name, len(tallies), _long_line(tallies), file=sys.stderr, flush=True)
            lines.append((name, *_long_line(tallies)))
    return format_table(heads, lines)


def _long_line(tallies: Sequence[Tally]) -> tuple[str, ...]:
    """Numbers of some days: shares in per cent, alarms per 1000 rows, most rows of a stuck slip."""

    def percent(part: str) -> str:
        return f"{100 * np.mean(np.concatenate([getattr(one, part) for one in tallies])):.1f}"

    covered = 100 * np.asarray([np.mean(one.covered, axis=0) for one in tallies])
    error = covered.std(axis=0, ddof=len(tallies) > 1) / np.sqrt(len(tallies))
    return (
        str(len(tallies)),
        *(f"{c:.1f} +- {e:.1f}" for c, e in zip(covered.mean(axis=0), error, strict=True)),
        percent("answered"),
        f"{1000 * np.mean(np.concatenate([one.false_alarms for one in tallies])):.1f}",
        f"{max(rows for one in tallies for rows in one.slip_stuck):.0f}",
        percent("stuck"),
    )


def main() -> None:
    """Print the table of many days."""
    number = int(sys.argv[1]) if len(sys.argv) > 1 else MANY_DAYS
    wheel = ROOT / "exported" / "wheel.onnx"
    print(table_of_many_days(wheel, number, sys.argv[2:] or LONG_WORLDS))


if __name__ == "__main__":
    main()
