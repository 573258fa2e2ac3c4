"""Small changes of soil: the tracker beside the best that any filter can do.

The best filter knows everything but the soil: the wheel, the noise, the prior of the soils, how
often they change, and which rows are glitches. It adds up the probability of every beginning of the
present soil. `python bench/small_changes.py`.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.interpolate import RegularGridInterpolator
from scipy.special import logsumexp
from scipy.stats import qmc

sys.path.insert(0, str(Path(__file__).parent))

from benchmarks_file import ROOT
from drawn_errors import DrawnErrors
from driven_days import (
    LOAD,
    ROWS_PER_SOIL,
    SLIP_STD,
    TORQUE_NOISE,
    Day,
    Floats,
    Kind,
    simulate_day,
    wheel_torque,
)

from soilml import Estimator, SoilTracker
from soilml.onboard.tracking import Event

#: Days, the first seed, and ends of the rms relative change of torque. Limits of the tracker were
#: chosen on days of other seeds.
DAYS, SEED, CHANGES = 8, 400, (0.05, 0.12)
#: A change counts as found within so many rows, and late rows of a soil as unchanged after so many.
SOON, LATE = 20, 40
#: The best filter: soils of the prior, and knots of slip and load at which their torque is known.
SOILS, SLIP_KNOTS, LOAD_KNOTS = 1024, 12, 4
PRIOR = np.asarray([[0.0, 3000.0], [0.436332, 0.785398], [0.005, 0.03]])
#: Probability of another soil from one row to the next, and above which it is told.
HAZARD, TOLD = 1.0 / ROWS_PER_SOIL, 0.9
#: Nodes of the quadrature over the noise of slip.
NODES = 7


@dataclass
class Findings:
    """Rows from each change until it was told, and rows of an unchanged soil with a false one."""

    delays: list[float] = field(default_factory=list)
    false: list[bool] = field(default_factory=list)

    def add(self, day: Day, told: set[int]) -> None:
        """Add a day on which changes were told at these rows."""
        begins = [row for row, _ in day.changes]
        last = begins[-1] + ROWS_PER_SOIL
        for row, size in day.changes:
            if CHANGES[0] <= size <= CHANGES[1]:
                rows = (i - row + 1.0 for i in sorted(told) if row <= i < row + ROWS_PER_SOIL)
                self.delays.append(next(rows, np.inf))
        for i in range(last):
            since = i - max([-LATE, *(row for row in begins if row <= i)])
            if since >= LATE and day.kinds[i] is Kind.SOUND:
                self.false.append(i in told)

    def line(self, name: str) -> str:
        """A line of the table."""
        found = np.asarray(self.delays)
        cells = (
            name,
            str(len(found)),
            f"{np.mean(found <= SOON):.0%}",
            f"{np.mean(found <= LATE):.0%}",
            f"{np.median(found):.0f}",
            f"{1000 * np.mean(self.false):.1f}",
        )
        return f"| {' | '.join(cells)} |"


class BestFilter:
    """The probability of every beginning of the present soil, by all soils of the prior.

    References: Adams and MacKay, Bayesian Online Changepoint Detection, arXiv:0710.3742, 2007.
    """

    def __init__(self) -> None:
        soils = qmc.scale(qmc.Sobol(3, seed=1).random(SOILS), *PRIOR.T)
        slip = np.geomspace(0.01, 0.8, SLIP_KNOTS)
        load = np.linspace(*LOAD, LOAD_KNOTS)
        points = np.stack(np.meshgrid(slip, load, indexing="ij"), axis=-1).reshape(-1, 2)
        none = DrawnErrors.drawn(1, 0, 0.0).of_rows(np.zeros(len(points), dtype=np.int64))
        torque = [
            wheel_torque(*points.T, np.broadcast_to(one, (len(points), 3)), none) for one in soils
        ]
        grid = np.log(np.stack(torque, axis=-1)).reshape(SLIP_KNOTS, LOAD_KNOTS, SOILS)
        self._log_torque = RegularGridInterpolator(
            (np.log(slip), load), grid, method="linear", bounds_error=False, fill_value=None
        )

    def told(self, day: Day) -> set[int]:
        """Rows at which a change is told."""
        rows = day.changes[-1][0] + ROWS_PER_SOIL
        sums = np.zeros((rows + 1, SOILS))
        for i in range(rows):
            sums[i + 1] = sums[i] + self._log_likelihood(day, i)
        begin, found, began = np.full(rows + 1, -np.inf), set(), 0
        begin[0] = 0.0
        for i in range(1, rows + 1):
            ages = i - 1 - np.arange(i)
            parts = begin[:i] + logsumexp(sums[i] - sums[:i], axis=1) - np.log(SOILS)
            parts += ages * np.log1p(-HAZARD)
            total = logsumexp(parts)
            begin[i] = total + np.log(HAZARD)
            since = np.exp(parts - total)[began + 1 :]
            if since.sum() > TOLD:
                began += 1 + int(np.argmax(since))
                found.add(i - 1)
        return found

    def _log_likelihood(self, day: Day, row: int) -> Floats:
        """Of a row on each soil, with the noise of slip integrated out, (soils,)."""
        if day.kinds[row] is not Kind.SOUND:
            return np.zeros(SOILS)
        nodes, weights = np.polynomial.hermite_e.hermegauss(NODES)
        read = day.row(row)
        slip = np.clip(read["slip"] + SLIP_STD * nodes, 0.005, 0.9)
        at = np.stack([np.log(slip), np.full(NODES, read["load"])], axis=1)
        torque = np.exp(self._log_torque(at))
        std = TORQUE_NOISE * torque
        logs = -0.5 * ((read["torque"] - torque) / std) ** 2 - np.log(std)
        return np.asarray(logsumexp(logs, axis=0, b=(weights / weights.sum())[:, None]))


def tracked(estimator: Estimator, day: Day) -> set[int]:
    """Rows at which the tracker tells a change."""
    tracker = SoilTracker(estimator)
    events = [tracker.read(**day.row(i)).event for i in range(day.changes[-1][0] + ROWS_PER_SOIL)]
    return {i for i, e in enumerate(events) if e in (Event.SOIL_CHANGED, Event.DRIFT)}


def table(file: Path, days: int = DAYS) -> str:
    """A line for each filter."""
    noise = {"slip": (SLIP_STD, 0.0), "torque": (0.0, TORQUE_NOISE)}
    estimator, best = Estimator.load(file).on(noise=noise), BestFilter()
    found = {"tracker": Findings(), "best possible": Findings()}
    for seed in range(SEED, SEED + days):
        size = float(np.random.default_rng(seed).uniform(*CHANGES))
        day = simulate_day(seed, change=size)
        found["tracker"].add(day, tracked(estimator, day))
        found["best possible"].add(day, best.told(day))
        print(seed, {k: v.delays for k, v in found.items()}, file=sys.stderr, flush=True)
    heads = "filter", "changes", f"found within {SOON} rows", f"within {LATE}", "median delay"
    lines = [f"| {' | '.join(heads)} | false changes per 1000 rows |", "|---|" + "---:|" * 5]
    return "\n".join(lines + [one.line(name) for name, one in found.items()])


if __name__ == "__main__":
    print(table(ROOT / "exported" / "wheel.onnx", *(int(word) for word in sys.argv[1:])))
