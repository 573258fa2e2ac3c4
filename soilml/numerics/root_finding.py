"""Roots of rising functions for whole batches, and a minimum between bounds."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from soilml.arrays import Array, Floats, namespace

#: A step smaller than this ends the search; the error after the last secant step is far smaller.
TOLERANCE = 1e-9
#: Bisection alone would take log2(bracket / TOLERANCE) steps, about 35 for a bracket of 32.
MAX_STEPS = 80
MAX_SLOPE = 1e12  # A secant steeper than this comes from rounding and is not used
#: From this step on, a step that is not half as long as the last one is replaced by bisection.
FIRST_CHECKED_STEP = 3


@dataclass(frozen=True)
class Root:
    """Where a function rises through zero, its slope there, and whether the search converged."""

    x: Array
    slope: Array
    converged: Array


def rising_root(
    f: Callable[[Array], Array], lower: Array, upper: Array, guess: Array, slope: Array
) -> Root:
    """Where `f` rises through zero between `lower` and `upper`, by secant steps inside a bracket.

    f: Function of an array of shape (batch,), element by element, with `f(lower) < 0`.
    lower, upper: The bracket, (batch,).
    guess, slope: Start of the search, and an estimate of df/dx > 0, (batch,).

    Returns: An element with `f(upper) < 0` has `x = upper` and `converged` false, so that a stalled
    bracket is not mistaken for a root. Where `f` rises, falls and rises again, the root need not be
    the first: `first_bracket` finds that one.
    """
    xp = namespace(guess)
    low, high = lower, upper
    nowhere = xp.zeros_like(guess, dtype=xp.bool)
    x = xp.clip(guess, lower, upper)
    done = converged = nowhere
    last_step = upper - lower
    previous_x, previous_y = x, x
    for step_number in range(MAX_STEPS):
        y = f(x)
        low = xp.where(~done & (y < 0), x, low)
        high = xp.where(~done & (y >= 0), x, high)
        no_root = ~done & (y < 0) & (x >= upper)
        done = done | no_root
        if step_number > 0:
            dx = x - previous_x
            secant = (y - previous_y) / xp.where(dx == 0, xp.ones_like(dx), dx)
            usable = (secant > 0) & (secant < MAX_SLOPE) & ~done
            slope = xp.where(usable, secant, slope)
        new = x - y / slope
        middle = 0.5 * (low + high)
        step = xp.abs(new - x)
        # a step past the upper end evaluates the upper end itself, once
        past = (new >= upper) & (high >= upper)
        outside = ~((new >= low) & (new <= high))
        slow = (step > 0.5 * last_step) & (step_number >= FIRST_CHECKED_STEP)
        new = xp.where(past, upper, xp.where(outside | slow, middle, new))
        step = xp.abs(new - x)
        just_converged = ~done & (step <= TOLERANCE)
        converged = converged | just_converged
        previous_x, previous_y = xp.where(done, previous_x, x), xp.where(done, previous_y, y)
        last_step = step
        x = xp.where(done, x, new)
        done = done | just_converged
        if bool(xp.all(done)):
            break
    return Root(x=x, slope=slope, converged=converged)


def first_bracket(f: Callable[[Array], Array], grid: Array) -> tuple[Array, Array, Array, Array]:
    """The first interval of a grid in which `f` rises through zero.

    f: Function of an array of shape (batch,), element by element.
    grid: Points (points, batch), increasing along the first axis.

    Returns: The ends of the interval, whether there is one, and the index of the point about which
    an earlier crossing may be hidden between points: the highest point before the interval from
    which `f` falls again, or the start of the interval if there is no such point, or the highest
    point of all if there is no interval. Shape (batch,).
    """
    xp = namespace(grid)
    y = xp.stack([f(grid[i, :]) for i in range(grid.shape[0])], axis=0)
    rises = (y[1:, :] >= 0) & (y[:-1, :] < 0)
    exists = xp.any(rises, axis=0)
    first = xp.argmax(xp.astype(rises, xp.int64), axis=0)
    is_peak = (y[1:-1, :] >= y[:-2, :]) & (y[1:-1, :] > y[2:, :])
    inner = xp.arange(1, grid.shape[0] - 1, device=grid.device)[:, None]
    earlier_peak = is_peak & exists[None, :] & (inner < first[None, :])
    least = xp.full_like(y[1:-1, :], -math.inf)
    highest = 1 + xp.argmax(xp.where(earlier_peak, y[1:-1, :], least), axis=0)
    peak = xp.where(exists, first, xp.argmax(y, axis=0))
    peak = xp.where(xp.any(earlier_peak, axis=0), highest, peak)
    lower = xp.take_along_axis(grid, first[None, :], axis=0)[0, :]
    upper = xp.take_along_axis(grid, (first + 1)[None, :], axis=0)[0, :]
    return lower, upper, exists, peak


T = TypeVar("T")

#: Longest step of a coordinate, and how often a step is shortened to a quarter.
LONGEST_STEP, SHORTENED = 1.5, 5


@dataclass(frozen=True, eq=False)
class Point(Generic[T]):
    """Coordinates x (p,), value and gradient (p,) of the function, and what else it found there."""

    x: Floats
    value: float
    gradient: Floats
    found: T


def bounded_minimum(
    function: Callable[[Floats], Point[T]],
    first: Point[T],
    inverse: Floats,
    bounds: tuple[Floats, Floats],
    enough: float,
    iterations: int,
) -> Point[T]:
    """The lowest point by BFGS, from a first one.

    A coordinate at a bound that its gradient presses against stays there. Where the function raises
    `numpy.linalg.LinAlgError`, the step is shortened.

    inverse (p, p): Of the expected curvature.
    bounds: Lower and upper ones, (p,) each.
    enough: Decrease that ends the search if no more is promised.

    References: Nocedal and Wright, Numerical Optimization, 2006, section 6.1.
    """
    low, high = bounds
    for _ in range(iterations):
        pressed = np.where(first.gradient > 0.0, first.x <= low, first.x >= high)
        slope = np.where(pressed, 0.0, first.gradient)
        step = np.where(slope == 0.0, 0.0, -inverse @ slope)
        if -float(slope @ step) < enough:
            break
        step *= min(1.0, LONGEST_STEP / float(np.abs(step).max()))
        new = _lower(function, first, step, bounds)
        if new is None:
            break
        moved, bent = new.x - first.x, np.where(slope == 0.0, 0.0, new.gradient - slope)
        if (curved := float(moved @ bent)) > 0.0:
            left = np.eye(len(moved)) - np.outer(moved, bent) / curved
            inverse = left @ inverse @ left.T + np.outer(moved, moved) / curved
        first = new
    return first


def _lower(
    function: Callable[[Floats], Point[T]],
    first: Point[T],
    step: Floats,
    bounds: tuple[Floats, Floats],
) -> Point[T] | None:
    """A lower point along a step."""
    for _ in range(SHORTENED):
        try:
            new = function(np.clip(first.x + step, *bounds))
        except np.linalg.LinAlgError:
            new = None
        if new is not None and new.value < first.value:
            return new
        step = 0.25 * step
    return None
