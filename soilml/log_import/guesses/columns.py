"""The columns of logs: what they state, how they behave, and how well each fits each role."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from soilml.arrays import Floats
from soilml.log_import.channels.runs import Run
from soilml.log_import.guesses.role_words import (
    CLEAR,
    USUAL,
    kinds_of,
    name_scores,
    says,
    words_of,
)
from soilml.log_import.mapping.channel_map import ROLES
from soilml.log_import.recording import Recording
from soilml.log_import.units import dimension, is_raw_signal, spelling, unit_in_name

#: Range of an angle or counter that starts again, by unit.
_PERIODS = (360.0, 2.0 * np.pi, 65536.0, 4096.0, 1024.0, 8192.0, 16384.0, 32768.0, 4294967296.0)
#: Days of a spreadsheet of the years 1968 to 2119, and their largest step: 10 s.
_DAYS = (25_000.0, 80_000.0, 1.2e-4)
#: Least size of clocks since 1970, in the units that count them.
_SINCE_1970 = (("ns", 5e17), ("us", 5e14), ("ms", 5e11), ("s", 5e8))
#: Largest size of a slip; least load, N, and largest range of a sinkage, mm, without a unit.
_MOST_SLIP, _LEAST_LOAD, _MOST_SINKAGE = 150.0, 1.0, 900.0
_FEWEST_PLACES = 10  # Fewest different values of a travel
_ALONG = 0.6  # Net change over the sum of all changes from which a column rises or falls
_MOST_TEXTS = 12  # Most columns of text that are listed


@dataclass(frozen=True)
class Candidate:
    """A column: its address, the unit that the log states, its values and its scores by role."""

    address: str
    name: str
    unit: str = ""
    kind: str | None = None  # The unit of soilml that its unit can be converted to
    count: int = 0  # Samples that are numbers
    low: float = float("nan")  # 1st and 99th percentile, and median
    high: float = float("nan")
    middle: float = float("nan")
    constant: bool = True  # Whether all samples are equal
    wraps_at: float = 0.0  # Range of an angle or a counter that starts again; 0 where it does not
    # Net change, a share of the sum of all changes: 1 for a monotone column, 0 for a single step
    travel: float = 0.0
    scores: dict[str, float] = field(default_factory=dict)

    @property
    def size(self) -> float:
        """The larger of the ends, without sign."""
        return max(abs(self.low), abs(self.high))

    @property
    def span(self) -> float:
        """From the lower to the upper end."""
        return self.high - self.low

    def score(self, role: str) -> float:
        """How well it fits a role; 0 where it does not."""
        return self.scores.get(role, 0.0)


def candidates_of(recordings: Sequence[Recording], steady: bool = False) -> list[Candidate]:
    """All numeric columns, with their scores; in a table of `steady` runs they may be constant."""
    counts = Counter(name for recording in recordings for name in recording.columns)
    return [
        _candidate(recording, name, counts[name] > 1, steady)
        for recording in recordings for name in recording.columns
    ]  # fmt: skip


def _candidate(recording: Recording, name: str, ambiguous: bool, steady: bool) -> Candidate:
    values = recording.columns[name]
    stated = recording.units.get(name, "")
    unit = stated if dimension(stated) else _unit_by_name(name)
    # the name of a topic says what its fields are of: /motor/left: current
    scores = name_scores(f"{recording.name} {name}" if recording.name else name)
    own_scores = name_scores(name)
    clear = max(own_scores.values(), default=0.0) >= CLEAR
    for role in {*scores, *own_scores}:
        own_score, score = own_scores.get(role, 0.0), scores.get(role, 0.0)
        if clear and not own_score:
            scores[role] = score - CLEAR  # fx of /force_torque is a force
        elif own_score >= CLEAR or role not in scores:
            scores[role] = max(own_score, score)
    topic_named = recording.name.startswith("/") or ambiguous
    address = f"{recording.name}:{name}" if topic_named and recording.name else name
    column = _behaving(Candidate(address, name, unit, dimension(unit) if unit else None), values)
    column = replace(column, constant=column.constant and not steady)
    if column.count < 2:
        return column
    totals = {role: _score(column, role, scores.get(role, 0.0), values) for role in ROLES}
    totals["time"] = _time_score(column, scores.get("time", 0.0), values)
    return replace(column, scores={role: total for role, total in totals.items() if total > 0.0})


def _behaving(column: Candidate, values: Floats) -> Candidate:
    """The column with what its samples (n,) show: a clock, an encoder, a place or a force."""
    own = values[np.isfinite(values)]
    if own.size < 2:
        return replace(column, count=own.size)
    low, middle, high = (float(v) for v in np.percentile(own, [1, 50, 99]))
    places = own[:: max(1, own.size // 60)]  # noise from sample to sample is no way
    changes = np.abs(np.diff(places))
    total = float(changes.sum())
    is_step = total > 0.0 and float(changes.max()) > 0.5 * total
    travel = abs(float(places[-1] - places[0])) / total if total and not is_step else 0.0
    return replace(
        column, count=own.size, low=low, high=high, middle=middle,
        constant=float(np.ptp(own)) == 0.0, wraps_at=_wrap(own), travel=travel,
    )  # fmt: skip


def _wrap(own: Floats) -> float:
    """The range after which a column starts again: few jumps back of nearly that size."""
    span, steps = float(np.ptp(own)), np.diff(own)
    jumps = np.flatnonzero(np.abs(steps) > 0.8 * span)
    others = np.delete(steps, jumps)
    if not 0 < jumps.size < own.size / 4 or span == 0.0 or others.size == 0:
        return 0.0
    # of a force that comes and goes, nothing moves between the jumps
    if np.percentile(np.abs(others), 99) > 0.25 * span or abs(others.sum()) < 0.3 * span:
        return 0.0
    return next((float(p) for p in _PERIODS if 0.93 * p < span <= 1.02 * p), 0.0)


def _unit_by_name(name: str) -> str:
    """The unit that ends a name; "" where it contradicts the rest, as newton does in `v_N`.

    What an analogue-digital converter gives are counts.
    """
    if "adc" in words_of(name):
        return "count"
    unit = unit_in_name(name)
    roles = name_scores(re.split(r"[_\s.\-]+", name)[0]).keys() & ROLES.keys()
    wanted = {kind for role in roles for kind in kinds_of(role)}
    if unit == "A" and "N m" in wanted:
        return unit  # a torque in ampere is a current
    return "" if len(unit) == 1 and wanted and dimension(unit) not in wanted else unit


def _time_score(column: Candidate, score: float, values: Floats) -> float:
    """How much a column looks like a clock: it rises, by even steps unless it is named one.

    A clock that is named may jitter, and show one time several times.
    """
    if column.kind not in (None, "s"):
        return 0.0
    named = score > 0.0 or column.kind == "s"
    steps = np.diff(values[np.isfinite(values)])
    moved = steps[steps != 0.0] if named else steps
    if (
        moved.size < 8
        or np.mean(moved > 0.0) < 0.97
        or (not named and says(column.name, "counters"))
    ):
        return 0.0
    if named:
        return score + (2.0 if column.kind == "s" else 0.0) + 1.0
    middle = float(np.median(steps))
    return float(np.mean(np.abs(steps - middle) < 0.5 * middle))


def _score(column: Candidate, role: str, score: float, values: Floats) -> float:
    """How well a column fits a role; 0 or less where it does not. `score` is that of its name."""
    kind, wanted, usual = column.kind, kinds_of(role), USUAL[role]
    if is_raw_signal(column.unit) and usual.raw and (kind == "1" or kind not in wanted):
        kind = None  # the name decides
    if kind is not None:
        if kind not in wanted and not (kind == "1" and role == "slip"):
            return 0.0
        if kind == "1" and role == "motor_current" and score < CLEAR:
            return 0.0  # i in per cent is a slip
        if kind == "1" and role != "slip" and spelling(column.unit) != "percent":
            return 0.0
        if kind == "count" and role == "wheel_angle":
            score -= 0.5  # an angle beside it needs no counts of a turn
        score += 2.5 if kind != "1" else 2.0 if role == "slip" and score > 0.0 else 1.0
        if score <= 2.5 and kind not in usual.alone:
            return 0.0
    if score <= 0.0:
        return 0.0
    if column.constant:
        score -= 3.0 if column.middle else 10.0
    monotone = column.travel > _ALONG or column.wraps_at > 0.0
    if role in ("wheel_angle", "position"):
        score += 1.5 if monotone else -2.5
        if np.unique(values[np.isfinite(values)]).size < _FEWEST_PLACES:
            score -= 4.0  # `s` of a few stages is a slip
    if role in ("wheel_speed", "ground_speed", "torque", "motor_current") and monotone:
        score -= 2.0
    if role == "load" and column.middle != 0.0:
        score += 1.0 if column.span < 1.5 * abs(column.middle) else -0.5
    if role == "drawbar_pull" and column.span < 0.3 * abs(column.middle):
        score -= 1.5  # a pull varies with slip
    if kind is None:  # of no size that the role may have
        score -= 4.0 * (role == "slip" and column.size > _MOST_SLIP)
        score -= 4.0 * (role == "load" and column.size < _LEAST_LOAD)
        score -= 8.0 * (role == "sinkage" and column.span > _MOST_SINKAGE)
    return score - 3.0 * (words_of(column.name)[:1] == ["std"])


def time_unit(values: Floats) -> tuple[str, bool]:
    """The likely unit of a clock: s, ms, us, ns or d, by its size and steps; whether it is clear.

    Loggers sample between once in two seconds and 20000 times a second; clocks since 1970 have ten
    digits in s, thirteen in ms. Spreadsheets count days since 1900. Seconds have steps below one.
    """
    own = values[np.isfinite(values)]
    if own.size < 2:
        return "s", False
    first, steps, span = float(abs(own[0])), np.diff(own), float(np.ptp(own))
    if since := next((unit for unit, least in _SINCE_1970 if first > least), ""):
        return since, True
    step = float(np.median(steps[steps > 0.0])) if np.any(steps > 0.0) else 0.0
    if _DAYS[0] < first < _DAYS[1] and step < _DAYS[2]:
        return "d", True
    if step > 5e5:
        return "ns", False
    if step >= 500.0 and span > 3.6e6:
        return "us", False
    unit = "ms" if step >= 1.0 and span > 300.0 and own.size > 50 else "s"
    return unit, unit == "s" and step < 1.0


def liveliest(runs: Sequence[Run]) -> Run:
    """The run with the most columns that vary: one in which no sensor is dead."""

    def varying(run: Run) -> int:
        every = (values for own in run.recordings for values in own.columns.values())
        known = (values[np.isfinite(values)] for values in every)
        return sum(own.size > 1 and float(np.ptp(own)) > 0.0 for own in known)

    return max(runs, key=varying)


def describe(columns: Sequence[Candidate], recordings: Sequence[Recording]) -> list[str]:
    """A line for each column: name, unit and range; and for those of text, which no channel is."""
    width = min(max((len(c.address) for c in columns), default=0), 44)
    lines = [
        f"{c.address:<{width}}  {c.unit or '-':<7} {c.low:>11.5g} .. "
        f"{c.high:<11.5g}" + (" constant" if c.constant else "")
        for c in columns
    ]
    texts = [own for recording in recordings for own in recording.texts.items()][:_MOST_TEXTS]
    for name, cells in texts:
        shown = list(dict.fromkeys(cell[:20] for cell in cells if cell))[:3]
        lines.append(f"{name[:44]}: text, such as {', '.join(map(repr, shown))}")
    return lines
