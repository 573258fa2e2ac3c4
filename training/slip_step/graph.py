"""The graph of one step of `SlipFilter`: belief and readings in, belief, speed, slips, flags out.

It computes what `soilml.slip_filter` computes, in single precision and with shapes that are
numbers. Where Python searches, the graph weighs: a place between nodes is the product with hat
functions, the first slip that pulls enough a sum over all slips.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from soilml.arrays import Floats
from soilml.numerics.quantiles import chi_squared_quantile
from soilml.onboard.slip_stream import FLAGS, JUDGED, QUANTILES, RECENT
from soilml.slip_filter.drive import LIKELY, QUANTILE, WIDE
from soilml.slip_filter.filter import TINY, SlipFilter, slip_of_ratio, squared
from training.onnx_graph import value
from training.onnx_graph.builder import FLOAT, Graph
from training.onnx_graph.value import Value, absolute, concat, constant, sqrt, where
from training.slip_step.force_curves import RATIO_ENDS, ForceCurves, at_ends

#: Places of the distribution function of the speed, in standard deviations about the mean.
PLACES = np.arange(-4.0, 4.01, 0.125)
FAR = 1e30  # Numbers beyond are not measured


def slip_step_model(filter_: SlipFilter, least_speed: float, gravity: float) -> Any:
    """The ONNX model of one step.

    filter_: With the table of n grounds and k wheels.
    least_speed: Speed of a rim below which a wheel counts as standing, m/s.
    gravity: m/s^2.

    Inputs (float32): grounds (n, 1 + 5 k) and recent (`RECENT`,), the belief; rim_speed (k,), m/s,
    torque (k,), N m, NaN or beyond 1e30 where there is none, load (k,), N, slope (1,), rad, elapsed
    (1,), s. Outputs: grounds_out and recent_out; speed (5,), m/s: mean, standard deviation and ends
    of the 90 % interval with the median between; slip (3, k) likewise; no_soil and beyond (1,);
    flags (`FLAGS`,), 1 where set.
    """
    graph = Graph()
    k, n = len(filter_.table.wheels), filter_.table.pull.shape[2]
    read = {
        name: Value(graph, name)
        for name in ("grounds", "recent", "rim_speed", "torque", "load", "slope", "elapsed")
    }
    _Step(graph, filter_).add(read, least_speed, gravity)
    begin = constant(graph, start_of(filter_)[0])
    graph.op("Identity", begin.name, out="start")
    shapes: dict[str, list[Any]] = {
        "grounds": [n, 1 + 5 * k], "recent": [RECENT], "rim_speed": [k], "torque": [k],
        "load": [k], "slope": [1], "elapsed": [1],
    }  # fmt: skip
    outputs: dict[str, list[Any]] = {
        "grounds_out": [n, 1 + 5 * k], "recent_out": [RECENT], "speed": [2 + len(QUANTILES)],
        "slip": [len(QUANTILES), k], "probability": [2], "flags": [len(FLAGS)],
        "start": [n, 1 + 5 * k],
    }  # fmt: skip
    return graph.model(shapes, {name: (FLOAT, shape) for name, shape in outputs.items()})


def start_of(filter_: SlipFilter) -> tuple[Floats, Floats]:
    """The belief before any row, as the graph takes it: grounds (n, 1 + 5 k), recent."""
    belief = filter_.start()
    n = len(belief.weight)
    parts = [belief.weight[:, None], *belief.mean.reshape(2, n, -1), *belief.cov.reshape(3, n, -1)]
    recent = np.full(RECENT, -1.0)
    recent[0] = 0.0
    return np.hstack(parts).astype(np.float32), recent.astype(np.float32)


class _Step:
    """The parts of a step; arrays of grounds are (n, 1), those of grounds and wheels (n, k)."""

    def __init__(self, graph: Graph, filter_: SlipFilter) -> None:
        self.graph, self.filter, self.table = graph, filter_, filter_.table
        self.errors, self.ratio = filter_.errors, filter_.ratio
        self.k = len(filter_.table.wheels)

    def add(self, read: dict[str, Value], least_speed: float, gravity: float) -> None:
        """Append all nodes; the outputs get their names."""
        recent = read["recent"]
        # in reverse all signs change
        way = where(read["rim_speed"].take([0], 0) < 0.0, constant(self.graph, [-1.0]), 1.0)
        raw = read["rim_speed"] * way
        usable = as_float(raw.reduce("ReduceMin", 0, True) > least_speed)
        middle, before = raw.mean(0, True), recent.take([1], 0)
        change = absolute(middle - before) / (read["elapsed"].clip(TINY) * gravity)
        steady = where(before > 0.0, change, 0.0) <= float(self.errors.pull_std)
        sound = usable * as_float(steady)
        standing = as_float(absolute(raw).max(0, True) <= least_speed)
        raw = where(usable > 0.5, raw, float(least_speed) + constant(self.graph, np.ones(self.k)))
        torque = read["torque"] * way
        size, most = absolute(torque), constant(self.graph, self.filter.most_torque)
        seen = size <= most
        wild = (as_float(size > most) * as_float(size < FAR)).max(0, True)
        load = read["load"].clip(float(self.table.load[0]), float(self.table.load[-1]))
        rim, apart, kept = self.filter.rims(value, recent.take([0], 0), raw)
        curves = ForceCurves(self.graph, self.table, rim, load)
        slope = read["slope"] * way
        share = constant(self.graph, self.filter.share[:, None])
        needed = (slope.node("Sin") + share) * self.filter.weight
        hot, part, missing, rise, place = self._balance(curves.pull(), needed)
        error = slope.node("Cos") * float(self.filter.weight * self.errors.slope_std)
        ends = [curves.torques(wheel, hot) for wheel in range(self.k)]
        low, high = (concat(own, 1) for own in zip(*ends, strict=True))
        weight, *parts = read["grounds"].split([1, *[self.k] * 5], 1)
        after, means, covs, misfit = self.filter.updated(
            value, (weight, parts[:2], parts[2:]), reading=where(seen, torque, 0.0),
            seen=as_float(seen), load=load, low=low, high=high, share=part, rise=rise,
            step=(hot * constant(self.graph, np.diff(-self.ratio)[None])).sum(1, True),
            missing=missing, kept=kept, error=error,
        )  # fmt: skip
        grounds = concat([after, *means, *covs], 1)
        row = constant(self.graph, self.filter.of_row[:, None])
        m = len(self.table.slip)
        moved = (place + error * row / rise).clip(0.0, float(m - 1))
        near = (1.0 - absolute(moved - constant(self.graph, np.arange(m)[None]))).clip(0.0)
        ratio = (near * constant(self.graph, self.ratio[None])).sum(1, True)  # at that place
        speed = ratio * rim.max(0, True)
        floor = constant(self.graph, self.table.floor[:, None].astype(float))
        no_soil = (after * floor).sum(0, True).reshape(1)
        beyond = (after * as_float(missing > 0.0)).sum(0, True).reshape(1)
        # a row that is passed over changes nothing
        where(sound > 0.5, grounds, read["grounds"]).named("grounds_out")
        old = recent.take(range(2, RECENT), 0)
        misfits = concat([misfit, recent.take(range(2, RECENT - 1), 0)], 0)
        judged = where(sound > 0.5, misfits, old)
        parts = [
            where(sound > 0.5, apart, recent.take([0], 0)),
            where(usable > 0.5, middle, before),
        ]
        concat([*parts, judged], 0).reshape(RECENT).named("recent_out")
        widest = self._name_answer(after, speed, way, rim)
        concat([no_soil, beyond], 0).reshape(2).named("probability")
        refused = as_float(no_soil > LIKELY)
        answered = sound * (1.0 - refused)
        doubts = [
            self._misfits(judged),
            as_float(beyond > LIKELY),
            as_float(widest > WIDE),
        ]
        flags = [standing, (1.0 - sound) * (1.0 - standing), refused * sound]
        flags += [doubt * answered for doubt in doubts]
        concat([*flags, wild * sound], 0).reshape(len(FLAGS)).named("flags")

    def _balance(self, pull: Value, needed: Value) -> tuple[Value, Value, Value, Value, Value]:
        """Which interval holds the least slip that pulls enough (n, m - 1), the share of the way in
        it, pull that is missing, rise, and the place (n, 1)."""
        m = len(self.table.slip)
        enough = (pull >= needed).astype(np.float32)
        before = enough @ constant(self.graph, np.triu(np.ones((m, m)), 1))
        first = enough * (before < 0.5).astype(np.float32)
        known = enough.max(1, True)
        begin, second, rest = first.split([1, 1, m - 2], 1)
        hot = concat([second + begin, rest], 1)
        last = np.eye(1, m - 1, m - 2)
        hot = hot + (1.0 - known) * constant(self.graph, last)
        low, high = at_ends(pull, hot, m)
        rise = (high - low).clip(1e-3 * float(self.filter.weight))
        share = where(known > 0.5, ((needed - low) / rise).clip(0.0, 1.0), 1.0)
        missing = where(known > 0.5, 0.0 * rise, needed - pull.max(1, True))
        place = (hot * constant(self.graph, np.arange(m - 1)[None])).sum(1, True) + share
        return hot, share, missing, rise, place

    def _speeds(self, weight: Value, speed: Value) -> tuple[list[Value], list[Value]]:
        """Mean and standard deviation (1,) of the speed, and its quantiles, rising."""
        mean = (weight * speed).sum(0, True)
        std = sqrt((weight * squared(speed - mean)).sum(0, True) + TINY)
        # the share of a ground whose speed is below a place: a ramp as wide as they are apart, so
        # that rounding moves no ground from one side to the other
        gap = float(PLACES[1] - PLACES[0])
        under = (
            constant(self.graph, PLACES[None] / gap + 0.5) - (speed - mean) / (std * gap)
        ).clip(0.0, 1.0)
        distribution = (weight * under).sum(0, True)  # (1, places)
        count = len(PLACES)
        low, high = distribution.columns(0, count - 1), distribution.columns(1, count)
        found = []
        for q in QUANTILES:
            share = ((q - low) / (high - low).clip(TINY)).clip(0.0, 1.0)
            steps = share.sum(1, True) * gap + float(PLACES[0])
            found.append((mean + std * steps).reshape(1))
        return [mean.reshape(1), std.reshape(1)], found

    def _name_answer(self, weight: Value, speed: Value, way: Value, rim: Value) -> Value:
        """Name the outputs `speed` and `slip`; the widest interval of a slip, (1,)."""
        (mean, spread), (low, median, high) = self._speeds(weight, speed)
        forward = way > 0.0
        ends = [
            where(forward, one, -other)
            for one, other in ((low, high), (median, median), (high, low))
        ]
        concat([mean * way, spread, *ends], 0).reshape(2 + len(QUANTILES)).named("speed")
        slips = [slip_of_ratio((v / rim).clip(*RATIO_ENDS), value) for v in (high, median, low)]
        slip = concat([one.reshape(1, self.k) for one in slips], 0)
        slip.reshape(len(QUANTILES), self.k).named("slip")
        widest: Value = (slips[2] - slips[0]).max(0, True)
        return widest.reshape(1)

    def _misfits(self, judged: Value) -> Value:
        """Whether the last rows have more misfit than sound ones, 0 or 1, (1,)."""
        degrees = float(JUDGED * self.k)
        limit = chi_squared_quantile(degrees, QUANTILE) / degrees
        full = as_float(judged.reduce("ReduceMin", 0, True) >= 0.0)
        return as_float(judged.mean(0, True) > float(limit)) * full


def as_float(condition: Value) -> Value:
    """1 where a condition is true, else 0."""
    return condition.astype(np.float32)
