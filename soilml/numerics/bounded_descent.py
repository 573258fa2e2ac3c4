"""The minimum of a smooth function between bounds, where its curvature is known roughly."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from soilml.arrays import Floats

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
