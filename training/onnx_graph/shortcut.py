"""Quicker ways to the same value, taken where a condition is true."""

from __future__ import annotations

from collections.abc import Callable

from training.onnx_graph.value import Value


def shortcut(
    condition: Value, quick: Callable[..., Value], general: Callable[..., Value], *values: Value
) -> Value:
    """The general function of float32 values, or where a condition (1,) is true, a quicker one.

    Only one of both is run. Both must give the same where the condition is true.
    """
    ways = []
    for way in (quick, general):
        branch = condition.graph.branch()
        ways.append((branch, way(*(value.within(branch) for value in values)).name))
    return Value(condition.graph, condition.graph.shortcut(condition.name, *ways))
