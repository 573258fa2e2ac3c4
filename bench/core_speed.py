"""Seconds that work takes of one core, and how fast that core was.

Machines that several users share change their speed: the forward model is solved before and after.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

import numpy as np

from soilml.config.case import Case
from soilml.physics.operating_point import Operating

#: Forward solutions in a second of the core that seconds are given for.
SOLVES = 500_000
#: Solutions of one call, and calls of a measurement; the first one, after other work, is slower by
#: half on one machine, and does not count.
SOLUTIONS, CALLS = 4000, 4

T = TypeVar("T")


def timed(case: Case, work: Callable[[], T]) -> tuple[T, float, float]:
    """Result and processor seconds of work, and forward solutions in a second of the wheel."""
    before = _forward_speed(case)
    started = time.process_time()
    result = work()
    seconds = time.process_time() - started
    return result, seconds, 0.5 * (before + _forward_speed(case))


def _forward_speed(case: Case) -> float:
    model = next(iter(case.gears.values()), case.model)
    rng = np.random.default_rng(0)
    at = Operating(slip=rng.uniform(0.1, 0.6, SOLUTIONS), load=rng.uniform(40.0, 80.0, SOLUTIONS))
    seconds = []
    for _ in range(CALLS):
        started = time.process_time()
        model(case.soil, at)
        seconds.append(time.process_time() - started)
    return SOLUTIONS / float(np.median(seconds[1:]))
