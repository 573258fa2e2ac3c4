"""Notes on a fit: estimates at a bound, and effects that would have to be far larger than usual."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from soilml.fitting.coordinates import Coordinate
from soilml.gap.evidence.marginal_likelihood import LARGEST_SIZE
from soilml.gap.evidence.problem import AT_BOUND
from soilml.remarks import Remark
from soilml.report.numbers import format_quantity


def bound_notes(coordinates: Sequence[Coordinate], x: Sequence[float]) -> list[Remark]:
    """Notes on what model.toml has at the end of a prior, with the effects that it contains."""
    effects = dict.fromkeys(c.effect for c in coordinates if c.effect)
    of_model = f"in model.toml ({' + '.join(effects) or 'the soil alone'})"
    at_bound = [
        c.path
        for c, value in zip(coordinates, x, strict=True)
        if not c.effect and min(value, 1.0 - value) < AT_BOUND
    ]
    several = len(at_bound) > 1
    verb, its = ("are", "their") if several else ("is", "its")
    prior, interval = ("priors", "intervals") if several else ("prior", "interval")
    text = (
        f"{', '.join(at_bound)} {of_model} {verb} at a bound of {its} {prior}: soilml identify has "
        f"{its} {interval}"
    )
    notes = [Remark("at-bound", text, tuple(at_bound))] if at_bound else []
    for c, size in zip(coordinates, x, strict=True):
        if c.effect and size > c.upper - AT_BOUND * (c.upper - c.lower):
            notes.append(
                Remark("at-bound", f"{c.path} {of_model} is at its upper bound", (c.path,))
            )
    return notes


def size_notes(coordinates: Sequence[Coordinate], x: Sequence[float]) -> list[Remark]:
    """Notes on effects that would have to be far larger than they usually are."""
    notes = []
    for c, size in zip(coordinates, x, strict=True):
        if c.effect and not c.is_shape and abs(size) > LARGEST_SIZE:
            value, usual = c.prior.at(np.asarray([size, 1.0]))
            text = (
                f"{c.name} of {c.effect} would have to be {format_quantity(value, c.unit)}, "
                f"{abs(size):.3g} times its usual size ({format_quantity(usual, c.unit)})"
            )
            notes.append(Remark("implausible-size", text, (c.effect,)))
    return notes
