"""Seconds that work takes of one core, and how fast that core was meanwhile.

Machines that several users share change their speed within seconds. The forward model is therefore
solved before, after, and every second of the work too; what that takes is not counted.
"""

from __future__ import annotations

import signal
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np

from soilml.config.case import Case
from soilml.physics.operating_point import Operating

#: Forward solutions in a second of the core that seconds are given for.
SOLVES = 500_000
#: Solutions of one call, and calls of a measurement; the first one, after other work, is slower by
#: half on one machine, and does not count.
SOLUTIONS, CALLS = 4000, 4
EVERY = 1.0  # Seconds of the core between two measurements

T = TypeVar("T")


@dataclass(frozen=True)
class Timed(Generic[T]):
    """What work returned, the seconds of one core that it took, and what the core solves in one."""

    result: T
    seconds: float
    solves: float  # forward solutions of the wheel in a second, the mean over the work

    @property
    def scaled(self) -> float:
        """Seconds of a core that makes `SOLVES` forward solutions in one."""
        return self.seconds * self.solves / SOLVES


def timed(case: Case, work: Callable[[], T]) -> Timed[T]:
    """Do work, and time it; the speed is that of the case's wheel."""
    speeds, spent, working = [_forward_speed(case)], 0.0, True

    def measure(*_: Any) -> None:
        nonlocal spent
        started = time.process_time()
        speeds.append(_forward_speed(case))
        spent += time.process_time() - started
        if working:
            signal.setitimer(signal.ITIMER_PROF, EVERY)

    before = signal.signal(signal.SIGPROF, measure)
    signal.setitimer(signal.ITIMER_PROF, EVERY)
    started = time.process_time()
    try:
        result = work()
    finally:
        working = False
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)
    seconds = time.process_time() - started - spent
    speeds.append(_forward_speed(case))
    return Timed(result, seconds, float(np.mean(speeds)))


def _forward_speed(case: Case) -> float:
    """Forward solutions of the case's wheel in a second of one core."""
    model = next(iter(case.gears.values()), case.model)
    rng = np.random.default_rng(0)
    at = Operating(slip=rng.uniform(0.1, 0.6, SOLUTIONS), load=rng.uniform(40.0, 80.0, SOLUTIONS))
    seconds = []
    for _ in range(CALLS):
        started = time.process_time()
        model(case.soil, at)
        seconds.append(time.process_time() - started)
    return SOLUTIONS / float(np.median(seconds[1:]))
