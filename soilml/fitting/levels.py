"""Levels: which slips, loads or speeds that were measured are one value that was set.

Values that differ by no more than their scatter are one level; see `find_levels`.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from soilml.arrays import Floats, Integers
from soilml.physics.operating_point import FROM_ORDER, Operating

#: Two levels are apart by this many standard deviations of their values, plus the second figure
#: divided by the number of values. In a simulation of 4 to 64 values of one normal or uniform
#: population, the best division reaches this separation in about 1 % of the cases.
SEPARATION, SEPARATION_OF_FEW = 2.0, 45.0
#: 99 % quantile of the standard normal distribution: the scatter of so many levels of the usual
#: scatter is below that limit.
Z_99 = 2.326
#: Gap, in standard deviations of the usual scatter, that divides levels without further evidence:
#: values of one level are rarely so far from both neighbours.
CLEAR_GAP = 4.0


@dataclass(frozen=True)
class LevelRule:
    """How far apart the values of a quantity are that count as two levels."""

    gap: float  # Smallest gap between two levels, unless repeated values show finer ones
    fine_gap: float  # Smallest gap between two levels that several runs repeat
    scatter: float  # Usual standard deviation of the values of one level
    step: float  # Width of one level where the values cover a range without gaps

    def with_noise(self, std: float) -> LevelRule:
        """The rule for values with measurement noise of this standard deviation."""
        return replace(
            self,
            gap=max(self.gap, CLEAR_GAP * std),
            fine_gap=max(self.fine_gap, CLEAR_GAP * std),
            scatter=max(self.scatter, std),
            step=max(self.step, 2.0 * CLEAR_GAP * std),
        )


#: Logarithms of loads: dead weights, friction of guides and load cells leave up to 8 % of scatter
#: about one load. Two loads of such a level differ by at most 16 %, and neighbours of several
#: rarely by more than 12 %. A fine level differs by more than a scale's error of 2 %.
LOG_LOAD_RULE = LevelRule(gap=0.12, fine_gap=0.02, scatter=0.08, step=0.24)
#: Slips: speed control leaves a scatter of about 0.01.
SLIP_RULE = LevelRule(gap=0.02, fine_gap=0.02, scatter=0.01, step=0.05)
#: Covariates by field of `Operating`: the logarithm of the speed like that of the load, whole
#: passes, and slip angles (rad) to about a degree.
COVARIATE_RULES = {
    "speed": LOG_LOAD_RULE,
    "pass_number": LevelRule(gap=0.5, fine_gap=0.5, scatter=0.1, step=1.0),
    "slip_angle": LevelRule(gap=0.02, fine_gap=0.02, scatter=0.01, step=0.05),
}
#: Rows are repeats of each other if their slips and the logarithms of their loads agree within
#: these: torque then differs by about the noise of usual sensors.
ALIKE_SLIP, ALIKE_LOG_LOAD = 0.02, 0.05
#: Speed (m/s) below which the scale of speeds is linear, so that zero and reverse have a place.
SLOW = 1e-3


@dataclass(frozen=True)
class Levels:
    """The levels of values (n,), ascending."""

    index: Integers  # (n,) level of each value
    count: int  # number of levels; a range without gaps counts as several


def find_levels(values: Floats, rule: LevelRule, run: Integers | None = None) -> Levels:
    """The levels of measured values.

    The sorted values are divided at their largest gaps: into as many levels as have gaps above
    that of the rule and well above the scatter within the levels. A smaller gap divides two levels
    only where several runs repeat both. What remains together and scatters by more than the rule
    says is a range without gaps, which is divided into levels of equal width.

    values (n,): On the scale of the rule: logarithms of loads, for example.
    run (n,): Run of each value. Equal values of one run count as one value that was set once;
        without runs, or in one run alone, each value counts.

    Examples
    --------
    >>> import numpy as np
    >>> from soilml.fitting.levels import LOG_LOAD_RULE, find_levels
    >>> find_levels(np.log([19.1, 19.6, 20.4, 21.2]), LOG_LOAD_RULE).count
    1
    >>> found = find_levels(np.log([40.3, 88.0, 60.2, 39.2, 91.0, 61.1]), LOG_LOAD_RULE)
    >>> found.count, found.index.tolist()
    (3, [0, 2, 1, 0, 2, 1])
    """
    values = np.asarray(values, dtype=np.float64)
    several_runs = run is not None and np.unique(run).size > 1
    if run is not None and several_runs:
        pairs = np.unique(np.stack([values, np.asarray(run, dtype=np.float64)]), axis=1)
    else:
        pairs = np.stack([np.sort(values), np.arange(values.size, dtype=np.float64)])
    groups = [
        part
        for group in _divide(pairs, rule.gap, rule, repeated=False)
        for fine in _divide(group, rule.fine_gap, rule, repeated=True)
        for part in _divide_range(fine, rule)
    ]
    low = np.asarray([group[0, 0] for group in groups])
    return Levels(np.searchsorted(low, values, side="right") - 1, len(groups))


def _divide(pairs: Floats, smallest: float, rule: LevelRule, *, repeated: bool) -> list[Floats]:
    """Sorted values and their runs, (2, n), divided into as many levels as the gaps support.

    `repeated`: only into levels that more than one run has.
    """
    values, n = pairs[0], pairs.shape[1]
    gaps = np.diff(values)
    order = np.argsort(-gaps, kind="stable")
    # differences of rounded decimals, such as 0.12 - 0.10, count as what was written
    for count in range(int(np.sum(gaps >= smallest * (1.0 - 1e-9))), 0, -1):
        parts = np.split(pairs, np.sort(order[:count]) + 1, axis=1)
        gap = float(gaps[order[count - 1]])
        if repeated and any(np.unique(part[1]).size < 2 for part in parts):
            continue
        few_in_each = n < 2 * len(parts)
        clear = few_in_each or gap >= CLEAR_GAP * rule.scatter
        if not clear:
            squares = sum(float(np.sum((part[0] - part[0].mean()) ** 2)) for part in parts)
            scatter = np.sqrt(squares / (n - len(parts)))
            clear = gap >= (SEPARATION + SEPARATION_OF_FEW / n) * scatter
        if clear:
            return parts
    return [pairs]


def _divide_range(pairs: Floats, rule: LevelRule) -> list[Floats]:
    """A range without gaps in levels of equal width; one level remains as it is."""
    values, n = pairs[0], pairs.shape[1]
    width = float(values[-1] - values[0])
    # the scatter may be above the usual one by its sampling error
    if n < 2 or values.std(ddof=1) <= rule.scatter * (1.0 + Z_99 / np.sqrt(2.0 * (n - 1))):
        return [pairs]
    count = int(width / rule.step) + 1
    number = np.minimum((values - values[0]) / width * count, count - 1).astype(np.int64)
    return [pairs[:, number == i] for i in np.unique(number)]


def load_levels(load: Floats, run: Integers | None = None, std: float = 0.0) -> Levels:
    """The levels of loads (n,) > 0, N; `std` is the measurement noise of a load, N."""
    load = np.asarray(load, dtype=np.float64)
    rule = LOG_LOAD_RULE.with_noise(std / float(np.median(load))) if std else LOG_LOAD_RULE
    return find_levels(np.log(load), rule, run)


def slip_levels(slip: Floats, run: Integers | None = None, std: float = 0.0) -> Levels:
    """The levels of slips (n,); `std` is the measurement noise of a slip."""
    return find_levels(np.asarray(slip, dtype=np.float64), SLIP_RULE.with_noise(std), run)


def covariate_levels(field: str, values: Floats, run: Integers | None = None) -> Levels:
    """The levels of a covariate (n,), by its field of `Operating`: speed, pass or slip angle."""
    values = np.asarray(values, dtype=np.float64)
    if field == "speed":
        values = np.arcsinh(values / SLOW)
    return find_levels(values, COVARIATE_RULES[field], run)


def is_one_load(load: Floats) -> bool:
    """Whether all loads (n,), N, are of one level."""
    return load_levels(load).count == 1


def replicate_rows(
    at: Operating, run: Integers | None = None, slip_std: float = 0.0, load_std: float = 0.0
) -> Integers:
    """Groups of rows that are repeats of each other, (n,), numbered from 0.

    Rows are replicates if their slips, loads and covariates are of the same levels, their slips
    differ by at most `ALIKE_SLIP` and the logarithms of their loads by at most `ALIKE_LOG_LOAD`,
    or by the measurement noise (`slip_std`, and `load_std` in N) where that is larger.
    """
    slip, load = (np.asarray(v, dtype=np.float64) for v in np.broadcast_arrays(at.slip, at.load))
    slip_width = max(ALIKE_SLIP, CLEAR_GAP * slip_std)
    load_width = max(ALIKE_LOG_LOAD, CLEAR_GAP * load_std / float(np.median(load)))
    groups = [
        _narrow_groups(slip, slip_levels(slip, run, slip_std), slip_width),
        _narrow_groups(np.log(load), load_levels(load, run, load_std), load_width),
    ]
    for field in fields(at):
        value = getattr(at, field.name)
        if field.name in ("slip", "load", *FROM_ORDER) or value is None:
            continue
        value = np.broadcast_to(value, slip.shape)
        if field.name in COVARIATE_RULES:
            groups.append(covariate_levels(field.name, value, run).index)
        else:
            groups.append(np.unique(value, return_inverse=True)[1].reshape(-1))
    _, joint = np.unique(np.stack(groups, axis=1), axis=0, return_inverse=True)
    return np.asarray(joint, dtype=np.int64).reshape(-1)


def _narrow_groups(values: Floats, levels: Levels, width: float) -> Integers:
    """Groups (n,) of values of one level that differ by at most `width` from each other."""
    group, first, last, number = np.zeros(len(values), dtype=np.int64), -np.inf, -1, -1
    for i in np.argsort(values, kind="stable"):
        if levels.index[i] != last or values[i] - first > width * (1.0 + 1e-9):
            number, first, last = number + 1, values[i], int(levels.index[i])
        group[i] = number
    return group
