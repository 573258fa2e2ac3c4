"""What a set posterior answers, as nodes of a graph: mean, covariance, interval, flags."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from training.graph import Graph
from training.sets.family import Context, Family
from training.sets.sampling import Sample

Floats = NDArray[np.float64]

#: Fractions of the posterior below the ends of the interval.
ENDS = (0.05, 0.95)
#: A set of which less than this share of the rows is inside the range is not estimated.
LEAST_INSIDE = 0.9
#: Share of the prior's spread above which an estimate is mostly the prior.
VAGUE = 0.8


@dataclass(frozen=True)
class Limits:
    """How large the misfit of a set may be, measured: by number of readings, rising."""

    readings: Floats
    misfit: Floats

    def at(self, count: Floats) -> Floats:
        """The largest misfit that sets of this many readings may have."""
        place = np.interp(np.log(count), np.log(self.readings), np.arange(len(self.readings)))
        return np.interp(place, np.arange(len(self.readings)), self.misfit)


def draw_answers(
    graph: Graph,
    family: Family,
    context: Context,
    sample: Sample,
    counted: str,
    limits: Limits,
    prefix: str,
) -> None:
    """Draws the outputs, each named `<prefix>set_<what>`.

    A set that is not in range, or whose readings no soil explains together, gets the prior.
    """
    op, small, q = graph.op, graph.small, family.targets
    value = _values(graph, family, sample.x)
    mean = op("MatMul", value, op("Transpose", sample.weights))
    off = op("Sub", value, mean)
    spread = op("Gemm", op("Mul", off, sample.weights), off, transB=1)
    square = op("MatMul", op("Mul", off, off), op("Transpose", sample.weights))
    low, high = _ends(graph, value, sample.weights)
    sound = _sound(graph, sample, counted, limits)
    prior = prior_of(family)
    std = op("Sqrt", square)
    found = {
        "mean": (mean, prior["mean"]),
        "std": (std, prior["std"]),
        "low": (low, prior["low"]),
        "high": (high, prior["high"]),
    }
    for name, (answer, otherwise) in found.items():
        chosen = op("Where", sound, answer, small(otherwise[:, None]))
        graph.reshaped(op("Mul", chosen, context.scale), q, out=f"{prefix}set_{name}")
    outer = op("MatMul", context.scale, op("Transpose", context.scale))
    chosen = op("Where", sound, spread, small(np.diag(prior["std"] ** 2)))
    op("Mul", chosen, outer, out=prefix + "set_covariance")
    graph.reshaped(sound, 1, out=prefix + "set_in_range")
    open_ = op("Greater", std, small(VAGUE * prior["std"][:, None]))
    graph.reshaped(op("Or", open_, op("Not", sound)), q, out=prefix + "set_abstains")
    op("Identity", sample.misfit, out=prefix + "set_misfit")


def prior_of(family: Family) -> dict[str, Floats]:
    """Mean, standard deviation and interval of the prior of each target, without their scale."""
    u = (np.arange(4096) + 0.5) / 4096
    axes = family.axes[: family.targets]
    values = np.stack([axis.value(axis.drawn(u)) for axis in axes])
    low, high = np.quantile(values, ENDS, axis=1)
    return {"mean": values.mean(axis=1), "std": values.std(axis=1), "low": low, "high": high}


def _values(graph: Graph, family: Family, x: str) -> str:
    """Estimated parameters (q, n) at coordinates (p, n), without their scale."""
    op, small, q = graph.op, graph.small, family.targets
    ends = [graph.constant(np.asarray([k], dtype=np.int64)) for k in (0, q, 0)]
    own = op("Slice", x, *ends)
    column = {
        key: small([[getattr(axis, key)] for axis in family.axes[:q]])
        for key in ("shift", "factor", "rate", "slope")
    }
    bent = op("Mul", column["factor"], op("Exp", op("Mul", column["rate"], own)))
    return op("Add", op("Add", column["shift"], bent), op("Mul", column["slope"], own))


def _ends(graph: Graph, value: str, weights: str) -> list[str]:
    """Values (q, 1) below which the fractions `ENDS` of the weights lie."""
    op = graph.op
    size = graph.op("Shape", value)
    one = graph.constant(np.asarray([1], np.int64))
    count = op("Slice", size, one, graph.constant(np.asarray([2], np.int64)))
    ranked, order = graph.ops("TopK", 2, value, count, axis=1, largest=0, sorted=1)
    own = op("GatherElements", op("Expand", weights, size), order, axis=1)
    below = op("CumSum", own, graph.constant(np.asarray(1, np.int64)))
    below = op("Sub", below, op("Mul", own, graph.small(0.5)))
    found = []
    for end, back in zip(ENDS, (1, 0), strict=True):  # outward, for the samples are few
        passed = op("Cast", op("Less", below, graph.small(end)), to=7)
        index = graph.reduced("ReduceSum", passed, 1, keep=True)
        index = op("Min", index, op("Sub", count, one))
        if back:
            index = op("Max", op("Sub", index, one), graph.constant(np.asarray([0], np.int64)))
        found.append(op("GatherElements", ranked, index, axis=1))
    return found


def _sound(graph: Graph, sample: Sample, counted: str, limits: Limits) -> str:
    """Whether the set is in range, and its readings are of one soil, (1, 1).

    Between the numbers of readings for which it was measured, the limit is interpolated in their
    logarithm; beyond the largest, it grows with the number.
    """
    op, small = graph.op, graph.small
    parts = graph.ops("Split", 3, counted, graph.constant(np.ones(3, dtype=np.int64)), axis=0)
    readings, rows, inside = parts
    knots = np.log(limits.readings)
    place = op("Log", op("Max", readings, small(limits.readings[0])))
    rises = np.diff(limits.misfit) / np.diff(knots)
    run = op("Clip", op("Sub", graph.reshaped(place, 1, 1), small(knots[:-1])), small(0.0))
    run = op("Min", run, small(np.diff(knots)))
    most = op("ReduceSum", op("Mul", run, small(rises)), keepdims=0)
    most = op("Add", graph.reshaped(most, 1), small(limits.misfit[:1]))
    more = op("Max", op("Sub", readings, small(limits.readings[-1])), small(0.0))
    most = op("Add", most, op("Mul", more, small(1.0 + 3.0 / np.sqrt(limits.readings[-1]))))
    fits = op("LessOrEqual", sample.misfit, most)
    enough = op("GreaterOrEqual", inside, op("Mul", rows, small(LEAST_INSIDE)))
    some = op("Greater", readings, small(0.5))
    return graph.reshaped(op("And", op("And", fits, enough), some), 1, 1)
