"""Element-wise search for the first crossing of zero.

Every element of a batch is its own scalar problem; all are stepped together.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from soilml.arrays import Array, namespace

#: A step smaller than this ends the search; the last secant step then leaves far less.
TOLERANCE = 1e-9
MOST_STEPS = 80


@dataclass(frozen=True)
class Root:
    """Where a function crosses zero, its slope there, and whether it does at all."""

    x: Array
    slope: Array
    found: Array


def crossing(
    f: Callable[[Array], Array], lower: Array, upper: Array, guess: Array, slope: Array
) -> Root:
    """Where `f` rises through zero between `lower` and `upper`: secant steps inside a bracket.

    `f(lower) < 0` is taken for granted. `guess` and `slope` (> 0, an estimate of df/dx) start the
    search. An element whose `f(upper) < 0` comes back with `x = upper` and `found` false, so
    that a caller never mistakes a stalled bracket for a root. Where `f` rises, falls and rises
    again, the crossing found need not be the first: a caller who cannot exclude that looks for it
    with `scan`. All arrays have one shape.
    """
    xp = namespace(guess)
    low, high = lower, upper
    low_known = xp.zeros_like(guess, dtype=xp.bool)
    x = xp.clip(guess, lower, upper)
    done = found = low_known
    last_step = upper - lower
    previous_x, previous_y = x, x
    for step_number in range(MOST_STEPS):
        y = f(x)
        # the bracket closes on the side that was evaluated
        low = xp.where(~done & (y < 0), x, low)
        high = xp.where(~done & (y >= 0), x, high)
        none_left = ~done & (y < 0) & (x >= upper)
        done = done | none_left
        if step_number > 0:
            dx = x - previous_x
            secant = (y - previous_y) / xp.where(dx == 0, xp.ones_like(dx), dx)
            good = (secant > 0) & (secant < 1e12) & ~done
            slope = xp.where(good, secant, slope)
        new = x - y / slope
        middle = 0.5 * (low + high)
        step = xp.abs(new - x)
        # a step past the upper end looks at the upper end itself, once
        past = (new >= upper) & (high >= upper)
        outside = ~((new >= low) & (new <= high))
        slow = (step > 0.5 * last_step) & (step_number > 2)
        new = xp.where(past, upper, xp.where(outside | slow, middle, new))
        step = xp.abs(new - x)
        settled = ~done & (step <= TOLERANCE)
        found = found | settled
        previous_x, previous_y = xp.where(done, previous_x, x), xp.where(done, previous_y, y)
        last_step = step
        x = xp.where(done, x, new)
        done = done | settled
        if bool(xp.all(done)):
            break
    return Root(x=x, slope=slope, found=found)


def scan(f: Callable[[Array], Array], grid: Array) -> tuple[Array, Array, Array, Array]:
    """First interval of `grid` in which `f` rises through zero: (lower, upper, exists, peak).

    `grid` has shape (points, batch), rising along its first axis. `peak` is the index of the point
    about which a caller may look closer for an earlier crossing between points: the highest before
    the interval from which `f` falls again, without such a point the start of the interval, and
    without an interval the highest of all.
    """
    xp = namespace(grid)
    y = xp.stack([f(grid[i, :]) for i in range(grid.shape[0])], axis=0)
    up = (y[1:, :] >= 0) & (y[:-1, :] < 0)
    exists = xp.any(up, axis=0)
    first = xp.argmax(xp.astype(up, xp.int64), axis=0)
    falls = (y[1:-1, :] >= y[:-2, :]) & (y[1:-1, :] > y[2:, :])
    inner = xp.arange(1, grid.shape[0] - 1, device=grid.device)[:, None]
    before = falls & exists[None, :] & (inner < first[None, :])
    least = xp.full_like(y[1:-1, :], -math.inf)
    earlier = 1 + xp.argmax(xp.where(before, y[1:-1, :], least), axis=0)
    peak = xp.where(exists, first, xp.argmax(y, axis=0))
    peak = xp.where(xp.any(before, axis=0), earlier, peak)
    lower = xp.take_along_axis(grid, first[None, :], axis=0)[0, :]
    upper = xp.take_along_axis(grid, (first + 1)[None, :], axis=0)[0, :]
    return lower, upper, exists, peak
