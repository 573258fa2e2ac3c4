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
from soilml.slip_filter.filter import (
    CHANGE,
    FLOOR_NOISE,
    KEPT,
    MODEL_NOISE,
    OUTLIER,
    OUTLIER_STD,
    POWER,
    ROWS_ALIKE,
    SlipFilter,
    travel_ratio,
)
from training.onnx_graph.builder import FLOAT, Graph
from training.onnx_graph.value import Value, absolute, concat, constant, exp, log, sqrt, where
from training.slip_step.force_curves import RATIO_ENDS, ForceCurves, slip_of

#: Places of the distribution function of the speed, in standard deviations about the mean.
PLACES = np.arange(-4.0, 4.01, 0.125)
TINY, FAR = 1e-12, 1e30  # Smallest divisor; numbers beyond are not measured


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
    graph, step = Graph(), _Step(filter_)
    k, n = len(filter_.table.wheels), filter_.table.pull.shape[2]
    read = {
        name: Value(graph, name)
        for name in ("grounds", "recent", "rim_speed", "torque", "load", "slope", "elapsed")
    }
    step.add(graph, read, least_speed, gravity)
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
    """The parts of a step; arrays of grounds are (n, 1), those of wheels lists of k."""

    def __init__(self, filter_: SlipFilter) -> None:
        self.filter, self.table, self.errors = filter_, filter_.table, filter_.errors
        self.ratio = travel_ratio(self.table.slip)
        self.n, self.k = self.table.pull.shape[2], len(self.table.wheels)
        self.soils = len(self.table.values)

    def add(self, graph: Graph, read: dict[str, Value], least_speed: float, gravity: float) -> None:
        """Append all nodes; the outputs get their names."""
        rims, recent = read["rim_speed"], read["recent"]
        # in reverse all signs change
        way = where(rims.take([0], 0) < 0.0, constant(graph, [-1.0]), 1.0)
        raw = rims * way
        usable = (raw.reduce("ReduceMin", 0, True) > least_speed).astype(np.float32)
        middle_raw, before = raw.reduce("ReduceMean", 0, True), recent.take([1], 0)
        change = absolute(middle_raw - before) / (read["elapsed"].clip(TINY) * gravity)
        uneven = where(before > 0.0, change, 0.0)
        steady = (uneven <= float(self.errors.pull_std)).astype(np.float32)
        standing = (absolute(rims).reduce("ReduceMax", 0, True) <= least_speed).astype(np.float32)
        sound = usable * steady
        raw = where(usable > 0.5, raw, float(least_speed) + constant(graph, np.ones(self.k)))
        torque = read["torque"] * way
        size, most = absolute(torque), constant(graph, self.filter.most_torque)
        seen = size <= most
        wild = (size > most).astype(np.float32) * (size < FAR).astype(np.float32)
        torque = where(seen, torque, 0.0)
        slope = read["slope"] * way
        load = read["load"].clip(float(self.table.load[0]), float(self.table.load[-1]))
        rim, apart, kept = self._rims(recent.take([0], 0), raw)
        curves = ForceCurves(graph, self.table, rim, load)
        pull = curves.pull()
        sin, cos = slope.node("Sin"), slope.node("Cos")
        share = constant(graph, self.filter._share[:, None])
        found = self._balance(graph, pull, (sin + share) * self.filter.weight)
        hot, part, missing, rise, place = found
        error = cos * float(self.filter.weight * self.errors.slope_std)
        ends = [curves.torques(i, hot) for i in range(self.k)]
        risen = [b - a for a, b in ends]
        model = [a + part * d for (a, _), d in zip(ends, risen, strict=True)]
        common = [d / rise * error for d in risen]
        step = (hot * constant(graph, np.diff(-self.ratio)[None])).sum(1, True)
        floor = constant(graph, self.table.floor[:, None].astype(float))
        loads = [load.take([i], 0) for i in range(self.k)]
        spread = []
        for i in range(self.k):
            of_speed = d_squared(risen[i] / step * float(self.errors.speed_std)) * kept
            of_floor = d_squared(loads[i] * float(FLOOR_NOISE * self.table.radius[i]))
            spread.append(of_speed * (1.0 - floor) + of_floor * floor)
        weight, mean, cov = self._mixed(read["grounds"])
        torques = [torque.take([i], 0) for i in range(self.k)]
        there = [seen.astype(np.float32).take([i], 0) for i in range(self.k)]
        after, new_mean, new_cov, misfit = self._weigh(
            weight, mean, cov, torques, there, model, spread, common, loads, missing
        )
        ratio = self._ratio_at(graph, place + error * constant(graph, self.filter._row[:, None])
                               / rise)  # fmt: skip
        speed = ratio * rim.reduce("ReduceMax", 0, True)
        no_soil = (after * floor).sum(0, True).reshape(1)
        beyond = (after * (missing > 0.0).astype(np.float32)).sum(0, True).reshape(1)
        answer, quantiles = self._speeds(graph, after, speed)
        self._outputs(graph, read, {
            "sound": sound, "way": way, "rim": rim, "answer": answer, "quantiles": quantiles,
            "after": after, "apart": apart, "middle": middle_raw, "misfit": misfit,
            "no_soil": no_soil, "beyond": beyond, "standing": standing, "usable": usable,
            "wild": wild.reduce("ReduceMax", 0, True),
        }, new_mean, new_cov)  # fmt: skip

    def _rims(self, apart: Value, rim: Value) -> tuple[Value, Value, Value]:
        """As `SlipFilter._rims`."""
        middle = rim.reduce("ReduceMean", 0, True)
        away = rim - middle
        now = d_squared(away / middle).sum(0, True) * (1.0 / max(self.k - 1, 1))
        joined = where(apart > 0.0, apart * ROWS_ALIKE + now * (1.0 - ROWS_ALIKE), now)
        kept = (1.0 - float(self.errors.speed_std**2) / joined.clip(TINY)).clip(0.0)
        return middle + kept * away, joined, kept

    def _balance(
        self, graph: Graph, pull: Value, needed: Value
    ) -> tuple[Value, Value, Value, Value, Value]:
        """Which interval holds the least slip that pulls enough (n, m - 1), the share of the way in
        it, pull that is missing, rise, and the place (n, 1)."""
        m = len(self.table.slip)
        enough = (pull >= needed).astype(np.float32)
        before = enough @ constant(graph, np.triu(np.ones((m, m)), 1))
        first = enough * (before < 0.5).astype(np.float32)
        known = enough.reduce("ReduceMax", 1, True)
        begin, second, rest = first.split([1, 1, m - 2], 1)
        hot = concat([second + begin, rest], 1)
        last = np.eye(1, m - 1, m - 2)
        hot = hot + (1.0 - known) * constant(graph, last)
        low = (pull.columns(0, m - 1) * hot).sum(1, True)
        high = (pull.columns(1, m) * hot).sum(1, True)
        rise = (high - low).clip(1e-3 * float(self.filter.weight))
        share = where(known > 0.5, ((needed - low) / rise).clip(0.0, 1.0), 1.0)
        missing = where(known > 0.5, 0.0 * rise, needed - pull.reduce("ReduceMax", 1, True))
        place = (hot * constant(graph, np.arange(m - 1)[None])).sum(1, True) + share
        return hot, share, missing, rise, place

    def _mixed(self, grounds: Value) -> tuple[Value, list[list[Value]], list[list[Value]]]:
        """As `SlipFilter._mixed`: weight, means [2][k] and covariances [3][k], (n, 1) each."""
        graph, k = grounds.graph, self.k
        old, *rest = grounds.split([1, *[k] * 5], 1)
        kept = old * (1.0 - CHANGE)
        weight = kept + constant(graph, CHANGE * self.filter._prior[:, None])
        same = kept / weight
        means, covs = rest[:2], rest[2:]
        middle = [(old * mean).sum(0, True) for mean in means]
        apart = [mean - one for mean, one in zip(means, middle, strict=True)]
        squares = [apart[0] * apart[0], apart[0] * apart[1], apart[1] * apart[1]]
        first = [self.errors.loss_std**2, 0.0, self.errors.gain_std**2]
        other = 1.0 - same
        new_means = [(same * mean + other * one) * KEPT
                     for mean, one in zip(means, middle, strict=True)]  # fmt: skip
        new_covs = []
        for cov, square, begin in zip(covs, squares, first, strict=True):
            pooled = (old * (cov + square)).sum(0, True)
            mixed = same * cov + other * pooled + same * other * square
            new_covs.append(mixed * KEPT**2 + float((1.0 - KEPT**2) * begin))
        split = [part.split(k, 1) for part in (*new_means, *new_covs)]
        return weight, split[:2], split[2:]

    def _weigh(
        self,
        weight: Value,
        mean: list[list[Value]],
        cov: list[list[Value]],
        torque: list[Value],
        there: list[Value],
        model: list[Value],
        spread: list[Value],
        common: list[Value],
        load: list[Value],
        missing: Value,
    ) -> tuple[Value, list[Value], list[Value], Value]:
        """As `SlipFilter._weigh`: weights (n, 1), means and covariances (n, k) each, misfit."""
        constant_noise, share = self.filter.noise
        gains, variances, residuals, parts = [], [], [], []
        precision: Any = 1.0
        shared: Any = 0.0
        for i in range(self.k):
            noise = d_squared(torque[i]) * float(share**2 + MODEL_NOISE**2) + float(
                constant_noise**2
            )
            gain = (cov[0][i] + cov[1][i] * model[i], cov[1][i] + cov[2][i] * model[i])
            variance = gain[0] + gain[1] * model[i] + (noise + spread[i])
            residual = torque[i] - float(self.errors.loss) - model[i] - mean[0][i] - (
                mean[1][i] * model[i])  # fmt: skip
            own = common[i] * there[i]
            precision = own * own / variance + precision
            shared = own * residual / variance + shared
            gains.append(gain)
            variances.append(variance)
            residuals.append(residual)
            parts.append(own)
        shared = shared / precision
        squares: Any = 0.0
        volume: Any = 0.0
        strange: Any = 0.0
        for i in range(self.k):
            wide = d_squared(load[i] * float(OUTLIER_STD * self.table.radius[i]))
            squares = d_squared(residuals[i]) / variances[i] * there[i] + squares
            volume = log(variances[i]) * there[i] + volume
            strange = (d_squared(residuals[i]) / wide + log(wide)) * there[i] + strange
        squares = squares - d_squared(shared) * precision
        sound = (squares + log(precision) + volume) * -0.5 + float(np.log1p(-OUTLIER))
        glitch = strange * -0.5 + float(np.log(OUTLIER))
        larger = sound.node("Max", glitch)
        both = larger + log(exp(sound - larger) + exp(glitch - larger))
        used = exp(sound - both)
        scale = float(1.0 / (self.errors.pull_std * self.filter.weight))
        logs = both * POWER - d_squared(missing * scale) * 0.5 + log(weight)
        after = exp(logs - logs.reduce("ReduceMax", 0, True))
        after = after / after.sum(0, True)
        new_mean: list[list[Value]] = [[], []]
        new_cov: list[list[Value]] = [[], [], []]
        for i in range(self.k):
            variance = variances[i] + parts[i] * parts[i] / precision
            left = residuals[i] - parts[i] * shared
            step = [used * there[i] * own / variance for own in gains[i]]
            for c in range(2):
                new_mean[c].append(mean[c][i] + step[c] * left)
            for c, (a, b) in enumerate(((0, 0), (0, 1), (1, 1))):
                new_cov[c].append(cov[c][i] - step[a] * gains[i][b])
        seen = there[0]
        for one in there[1:]:
            seen = seen + one
        misfit = (after * squares).sum(0, True).reshape(1) / seen.clip(1.0)
        return (after, [concat(one, 1) for one in new_mean], [concat(one, 1) for one in new_cov],
                misfit)  # fmt: skip

    def _ratio_at(self, graph: Graph, place: Value) -> Value:
        """Travel over rolling (n, 1) at places of the table."""
        m = len(self.table.slip)
        away = absolute(place.clip(0.0, float(m - 1)) - constant(graph, np.arange(m)[None]))
        return ((1.0 - away).clip(0.0) * constant(graph, self.ratio[None])).sum(1, True)

    def _speeds(self, graph: Graph, weight: Value, speed: Value) -> tuple[list[Value], list[Value]]:
        """Mean and standard deviation (1,) of the speed, and its quantiles, rising."""
        mean = (weight * speed).sum(0, True)
        std = sqrt((weight * d_squared(speed - mean)).sum(0, True) + TINY)
        # the share of a ground whose speed is below a place: a ramp as wide as they are apart, so
        # that rounding moves no ground from one side to the other
        gap = float(PLACES[1] - PLACES[0])
        under = (constant(graph, PLACES[None] / gap + 0.5) - (speed - mean) / (std * gap)).clip(
            0.0, 1.0
        )
        distribution = (weight * under).sum(0, True)  # (1, places)
        count = len(PLACES)
        low, high = distribution.columns(0, count - 1), distribution.columns(1, count)
        found = []
        for q in QUANTILES:
            share = ((q - low) / (high - low).clip(TINY)).clip(0.0, 1.0)
            steps = share.sum(1, True) * gap + float(PLACES[0])
            found.append((mean + std * steps).reshape(1))
        return [mean.reshape(1), std.reshape(1)], found

    def _outputs(
        self,
        graph: Graph,
        read: dict[str, Value],
        made: dict[str, Any],
        mean: list[Value],
        cov: list[Value],
    ) -> None:
        """Name the outputs; a row that is passed over changes nothing."""
        sound, way, recent = made["sound"], made["way"], read["recent"]
        grounds = concat([made["after"], *mean, *cov], 1)
        where(sound > 0.5, grounds, read["grounds"]).named("grounds_out")
        old = recent.take(range(2, RECENT), 0)
        misfits = concat([made["misfit"], recent.take(range(2, RECENT - 1), 0)], 0)
        new = concat([where(sound > 0.5, made["apart"], recent.take([0], 0)),
                      where(made["usable"] > 0.5, made["middle"], recent.take([1], 0)),
                      where(sound > 0.5, misfits, old)], 0)  # fmt: skip
        new.reshape(RECENT).named("recent_out")
        low, median, high = made["quantiles"]
        forward = way > 0.0
        ends = [where(forward, low, -high), where(forward, median, -median),
                where(forward, high, -low)]  # fmt: skip
        first, spread = made["answer"]
        concat([first * way, spread, *ends], 0).reshape(2 + len(QUANTILES)).named("speed")
        slips = [slip_of((v / made["rim"]).clip(*RATIO_ENDS)) for v in (high, median, low)]
        slip = concat([s.reshape(1, self.k) for s in slips], 0)
        slip.reshape(len(QUANTILES), self.k).named("slip")
        no_soil, beyond = made["no_soil"], made["beyond"]
        concat([no_soil, beyond], 0).reshape(2).named("probability")
        degrees = float(JUDGED * self.k)
        limit = chi_squared_quantile(degrees, QUANTILE) / degrees
        judged = where(sound > 0.5, misfits, old)
        full = (judged.reduce("ReduceMin", 0, True) >= 0.0).astype(np.float32)
        misfit = (judged.reduce("ReduceMean", 0, True) > float(limit)).astype(np.float32) * full
        width = (slips[2] - slips[0]).reduce("ReduceMax", 0, True).reshape(1)
        refused = (no_soil > LIKELY).astype(np.float32)
        answered = sound * (1.0 - refused)
        flags = [
            made["standing"],
            (1.0 - sound) * (1.0 - made["standing"]),
            refused * sound,
            misfit * answered,
            (beyond > LIKELY).astype(np.float32) * answered,
            (width > WIDE).astype(np.float32) * answered,
            made["wild"] * sound,
        ]
        concat(flags, 0).reshape(len(FLAGS)).named("flags")


def d_squared(x: Value) -> Value:
    """x times itself."""
    return x * x
