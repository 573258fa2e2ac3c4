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
    notes = []
    effects = dict.fromkeys(c.effect for c in coordinates if c.effect)
    of_model = f"model.toml ({' + '.join(effects) or 'the soil alone'})"
    for c, value in zip(coordinates, x, strict=True):
        end = ""
        if not c.effect and min(value, 1.0 - value) < AT_BOUND:
            end = "a bound of its prior: soilml identify has its interval"
        elif c.effect and value > c.upper - AT_BOUND * (c.upper - c.lower):
            end = "its upper bound"
        if end:
            notes.append(Remark("at-bound", f"{c.path} in {of_model} is at {end}", (c.path,)))
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
