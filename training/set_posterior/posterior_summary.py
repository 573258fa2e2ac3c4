"""What a set posterior answers, as nodes of a graph: mean, covariance, interval, flags."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.onboard.estimate import VAGUE
from training.onnx_graph.builder import Graph
from training.set_posterior.importance_sampler import Sample
from training.set_posterior.wheel_family import Context, WheelFamily

Floats = NDArray[np.float64]

#: Fractions of the posterior below the ends of the interval.
ENDS = (0.05, 0.95)
#: A set of which less than this share of the rows is inside the range is not estimated.
LEAST_INSIDE = 0.9
#: Standard deviations from the mean between which an end of the interval is looked for.
RUNGS = np.arange(0.5, 3.3, 0.25)
#: Stands for a factor that is zero, whose logarithm is taken.
NOTHING = 1e-30


@dataclass(frozen=True)
class Limits:
    """How large the misfit of a set may be, measured: by number of readings, rising."""

    readings: Floats
    misfit: Floats


def draw_answers(
    graph: Graph,
    family: WheelFamily,
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
    value = _values(graph, family, sample)
    mean = op("Gemm", value, sample.weights, transB=1)
    off = op("Sub", value, mean)
    spread = op("Gemm", op("Mul", off, sample.weights), off, transB=1)
    square = graph.reduced("ReduceSum", op("Mul", spread, small(np.eye(q))), 1, keep=True)
    std = op("Sqrt", square)
    reach = _reach(graph, op("Div", off, std), sample.weights, sample.count)
    ends_ = op("Add", mean, op("Mul", std, reach))
    sound = _sound(graph, sample, counted, limits)
    prior = prior_of(family)
    names = ("mean", "std", "low", "high")
    found = op("Concat", mean, std, ends_, axis=1)
    otherwise = small(np.stack([prior[name] for name in names], axis=1))
    chosen = op("Mul", op("Where", sound, found, otherwise), context.scale)
    for name, part in zip(names, graph.ops("Split", 4, chosen, axis=1, num_outputs=4), strict=True):
        graph.reshaped(part, q, out=f"{prefix}set_{name}")
    outer = op("Gemm", context.scale, context.scale, transB=1)
    chosen = op("Where", sound, spread, small(np.diag(prior["std"] ** 2)))
    op("Mul", chosen, outer, out=prefix + "set_covariance")
    graph.reshaped(sound, 1, out=prefix + "set_in_range")
    open_ = op("Greater", std, small(VAGUE * prior["std"][:, None]))
    graph.reshaped(op("Or", open_, op("Not", sound)), q, out=prefix + "set_abstains")
    op("Identity", sample.misfit, out=prefix + "set_misfit")


def prior_of(family: WheelFamily) -> dict[str, Floats]:
    """Mean, standard deviation and interval of the prior of each target, without their scale."""
    u = (np.arange(4096) + 0.5) / 4096
    axes = family.axes[: family.targets]
    values = np.stack([axis.value(axis.drawn(u)) for axis in axes])
    low, high = np.quantile(values, ENDS, axis=1)
    return {"mean": values.mean(axis=1), "std": values.std(axis=1), "low": low, "high": high}


def _values(graph: Graph, family: WheelFamily, sample: Sample) -> str:
    """Estimated parameters (q, n) of a sample, without their scale."""
    op, small, q = graph.op, graph.small, family.targets
    even, bent = np.zeros((2, q, 1 + len(family.axes)))
    for k, axis in enumerate(family.axes[:q]):
        place = 1 + sample.order.index(k)
        even[k, [0, place]] = axis.shift, axis.slope
        bent[k, [0, place]] = np.log(max(axis.factor, NOTHING)), axis.rate
    curve = op("Exp", op("MatMul", small(bent), sample.points))
    return op("Add", op("MatMul", small(even), sample.points), curve)


def _reach(graph: Graph, off: str, weights: str, count: int) -> str:
    """Ends (q, 2) of the interval, of deviations (q, n) over their standard deviation.

    The shares of the weights (1, n) that lie below the rungs are interpolated.
    """
    op, small = graph.op, graph.small
    steps = len(RUNGS) - 1
    rungs = np.concatenate([-RUNGS[::-1], RUNGS])
    apart = graph.op("Reshape", off, graph.constant(np.asarray([0, 1, -1], np.int64)))
    below = op("Cast", op("Less", apart, small(rungs[:, None])), to=1)
    below = graph.reshaped(below, -1, count)
    share = graph.reshaped(op("Gemm", below, weights, transB=1), -1, len(rungs))
    # where between two rungs the share passes that of the end, from 0 to 1
    start, rise = np.zeros((2, 2 * steps + 2, 2 * steps))
    step, first = np.zeros((2 * steps, 2)), rungs[[0, steps + 1]]
    for k in range(2):
        for i in range(steps):
            at, rung = k * steps + i, k * (steps + 1) + i
            start[rung, at] = -1.0
            rise[rung, at], rise[rung + 1, at] = -1.0, 1.0
            step[at, k] = rungs[rung + 1] - rungs[rung]
    left = op("Gemm", share, small(start), small(np.repeat(ENDS, steps)))
    part = op("Div", left, op("Max", op("MatMul", share, small(rise)), small(1e-6)))
    part = op("Clip", part, small(0.0), small(1.0))
    return op("Gemm", part, small(step), small(first))


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
