"""Rows of a batch that were solved apart, put back in order."""

from __future__ import annotations

from dataclasses import fields

from soilml.arrays import Array, namespace
from soilml.physics.contact import Force


def merge_rows(force: Force, keep: Array, others: Force) -> Force:
    """`force` where `keep`, and the rows of `others`, in order, elsewhere."""
    xp = namespace(force.load)
    position = merged_position(keep)
    merged = {}
    for field in fields(Force):
        both = xp.concat([getattr(force, field.name), getattr(others, field.name)], axis=0)
        merged[field.name] = xp.take(both, position, axis=0)
    return Force(**merged)


def merged_position(keep: Array) -> Array:
    """Where each merged row is, in all rows followed by the rows that are not kept."""
    xp = namespace(keep)
    size = keep.shape[0]
    return xp.where(
        keep,
        xp.arange(size, device=keep.device),
        size - 1 + xp.cumulative_sum(xp.astype(~keep, xp.int64)),
    )
