"""Simulated days of driving, which the tracker follows."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from driven_days import SLIP_STD, TORQUE_NOISE, Day, Kind, simulate_day
from runner import ROOT, Bench, Row, Sample, table

from soilml import Estimator, SoilTracker
from soilml.onboard.tracking import Event

#: Days of each line, and the first seed. Limits of the tracker were chosen on days of other seeds.
DAYS, SEED = 12, 100
#: Rows after a change from which the soil counts as steady.
SETTLED = 20
#: A soil that changed is found if the tracker says so within so many rows.
WITHIN = 40
#: Sizes of a change, as rms relative change of torque, by which delays are listed.
SIZES = {"below 10 %": 0.0, "10 to 20 %": 0.1, "above 20 %": 0.2}
#: Worlds: mechanism that the files do not model, its size, and size of usual errors.
WORLDS = {
    "as modelled": ("", 0.0, 0.0),
    "slip-sinkage 0.3": ("slip-sinkage", 0.3, 0.0),
    "grousers of 10 mm": ("grousers", 0.01, 0.0),
    "all typical errors": ("", 0.0, 1.0),
}
#: Answers, and what the file is told of errors of its model.
ANSWERS: dict[str, dict[str, float]] = {
    "tracker, `model_error` 0": {"model_error": 0.0},
    "tracker, averaged": {},
}
#: Deviation in standard deviations of a soil that the estimate is wrong about.
FAR = 3.0
ABOUT = (
    "Simulated days of the reference wheel of `datagen/blind_sets`. A day has three soils of 100 "
    "rows, 2 % torque noise, and slip with a standard deviation of 0.02. Of the rows, 2 % are "
    "glitches (torque doubled or zero, slip off by a half); torque is stuck for 20 rows, slip for "
    "15, and a pause lasts 10. Over the last 150 rows the friction angle falls by 7 degrees or the "
    "zero of the torque sensor rises by 0.5 N m.\n\n"
    "Width: median standard deviation over that of the prior. Intervals and flag `in_range`: rows "
    f"from the {SETTLED}th on one soil on, glitches apart; the flag of rows that the tracker used. "
    "Alarms: sound rows of unchanged soil that were set aside or called a change, drift or stuck "
    "sensor. Changes by rms change of torque: how many were detected "
    f"within {WITHIN} rows; median and largest delay in rows. Drift: how many were flagged; median "
    "and largest delay. Last column: of the rows in a drift whose mean is off by more than so many "
    "standard deviations, the share that carries a flag, and their number. Averaged: over sizes of "
    "the model's errors, as by default. Slip stuck: the most rows of it that were used on a day, "
    "up to the last. All typical errors: those of sensors are drawn for each day, those of bearing "
    "and contact for each soil."
)


def cases(sample: Sample) -> list[Row]:
    """Each day of each world with each answer."""
    days = sample.of(range(SEED, SEED + DAYS))
    return [{"world": w, "answer": a, "seed": s} for w in WORLDS for a in ANSWERS for s in days]


def one_day(case: Row) -> Row:
    """What happened on a day."""
    mechanism, size, errors = WORLDS[case["world"]]
    drift = ("friction", "zero")[case["seed"] % 2]
    day = simulate_day(case["seed"], drift, mechanism, size, errors)
    noise = {"slip": (SLIP_STD, 0.0), "torque": (0.0, TORQUE_NOISE)}
    file = Estimator.load(ROOT / "exported" / "wheel.onnx")
    return tracked(file.on(noise=noise, **ANSWERS[case["answer"]]), day)


def tracked(estimator: Estimator, day: Day) -> Row:
    """The day as the tracker follows it."""
    tracker = SoilTracker(estimator)
    states = [tracker.read(**day.row(i)) for i in range(len(day.kinds))]
    events, estimates = [s.event for s in states], [s.estimate for s in states]
    used = [event is Event.ACCEPTED for event in events]
    changed = [i for i, e in enumerate(events) if e in (Event.SOIL_CHANGED, Event.DRIFT)]
    alarms = (Event.SOIL_CHANGED, Event.DRIFT, Event.SET_ASIDE, Event.STUCK)
    unchanged = [
        i < day.changes[0][0] or rows_after_change(day, i) >= WITHIN for i in range(len(events))
    ]

    def those(kind: Kind, *told: Event) -> list[bool]:
        return [e in told for k, e in zip(day.kinds, events, strict=True) if k is kind]

    stuck = [i for i, kind in enumerate(day.kinds) if kind is Kind.SLIP_STUCK]
    begin = day.kinds.index(Kind.DRIFTING)
    flags = [state.drifting or state.rows_in_question > 0 for state in states]
    return steady(day, estimates, used) | {
        "delays": [
            (size, delay(row, [i for i in changed if i < row + WITHIN]))
            for row, size in day.changes
        ],
        "alarms": [
            e in alarms
            for k, e, same in zip(day.kinds, events, unchanged, strict=True)
            if k is Kind.SOUND and same
        ],
        "glitches": those(Kind.GLITCH, Event.SET_ASIDE, Event.UNUSABLE),
        "stuck": those(Kind.STUCK, Event.STUCK, Event.SET_ASIDE),
        # up to the last that is used: a later one counts as never set aside
        "slip_stuck": max((j + 1 for j, i in enumerate(stuck) if used[i]), default=0),
        "paused": those(Kind.PAUSED, Event.REPEATED, Event.UNUSABLE),
        "drift": delay(begin, changed),
        "far": far_rows(day, estimates, flags),
    }


def delay(begin: int, told: Sequence[int]) -> float | None:
    """Rows from a begin to the first that tells of it; None if none does."""
    return next((i - begin + 1.0 for i in told if i >= begin), None)


def rows_after_change(day: Day, row: int) -> int:
    """Rows since the last change of soil."""
    return row - max([0, *(first for first, _ in day.changes if first <= row)])


def steady(day: Day, estimates: Sequence[Any], used: Sequence[bool]) -> Row:
    """Of steady rows: whether the intervals hold, and of used ones, whether they are in range."""
    rows = [
        i
        for i, kind in enumerate(day.kinds)
        if kind is Kind.SOUND and rows_after_change(day, i) >= SETTLED
    ]
    own = [(estimates[i], day.soils[i]) for i in rows]
    return {
        "covered": [(e.low <= soil) & (soil <= e.high) for e, soil in own],
        "width": [e.std / e.prior_std for e, _ in own],
        "answered": [bool(estimates[i].in_range) for i in rows if used[i]],
    }


def far_rows(day: Day, estimates: Sequence[Any], flags: Sequence[bool]) -> list[bool]:
    """Of rows in a drift whose estimate is far from the soil: whether that was flagged."""
    return [
        flags[i]
        for i, (kind, e) in enumerate(zip(day.kinds, estimates, strict=True))
        if kind is Kind.DRIFTING and np.any(np.abs(e.mean - day.soils[i]) > FAR * e.std)
    ]


def joined(rows: list[Row], member: str) -> list[Any]:
    """Lists of all days as one."""
    return [value for row in rows for value in row[member]]


def all_days(member: str, form: str, of: Any = np.mean, scale: float = 1.0):  # type: ignore[no-untyped-def]
    """A statistic of what the rows of all days have."""

    def cell(rows: list[Row]) -> str:
        values = joined(rows, member)
        found = np.atleast_1d(of(values, axis=0)) * scale if values else []
        return " / ".join(format(value, form) for value in found) or "-"

    return cell


def delays(found: list[float | None]) -> str:
    """Share found, median and largest delay of those."""
    told = [rows for rows in found if rows is not None]
    many = f"{len(told)} of {len(found)}" if found else "-"
    return f"{many}; {np.median(told):.0f}, {max(told):.0f}" if told else many


def tables(rows: list[Row]) -> str:
    """A line for each world and answer."""
    ends = [*SIZES.values(), np.inf]
    columns = {
        "coverage of 90 % intervals: c / phi / K": all_days("covered", ".0%"),
        "width": all_days("width", ".2f", np.median),
        "in range": all_days("answered", ".0%"),
        "alarms per 1000 rows": all_days("alarms", ".1f", scale=1000.0),
    }
    for name, (low, high) in zip(SIZES, pairwise(ends), strict=True):
        columns[f"change {name}"] = lambda own, low=low, high=high: delays(
            [rows for size, rows in joined(own, "delays") if low <= size < high]
        )
    columns |= {
        "glitches set aside": all_days("glitches", ".0%"),
        "torque stuck": all_days("stuck", ".0%"),
        "slip stuck, rows used": lambda own: max(r["slip_stuck"] for r in own),
        "pause": all_days("paused", ".0%"),
        "drift": lambda own: delays([r["drift"] for r in own]),
        f"flagged beyond {FAR:g} std": lambda own: (
            f"{all_days('far', '.0%')(own)} of {len(joined(own, 'far'))}"
        ),
    }
    return table(rows, {"world": "world", "answer": "answer"}, columns)


STREAMS = Bench("streams", "A day of driving", ABOUT, cases, one_day, tables)
