"""The filter: which soils, and which slip on each, agree with the rows of a drive so far.

It needs numpy alone. The soils are those of a table made beforehand. Each has a probability, and
for each wheel a Gaussian of the losses of its drive, so that no soil is drawn again along the way.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from soilml.arrays import Floats
from soilml.config.wheeled_rover import DriveErrors
from soilml.numerics.prior import Prior
from soilml.numerics.quantiles import weighted_quantiles
from soilml.slip_filter.force_table import ForceTable

CHANGE = 0.01  # Probability that a row is on another soil than the row before
FLOOR_SHARE = 0.05  # Probability of a hard floor before any row
ROWS_ALIKE = 0.9  # Weight of earlier rows in the variance of the rim speeds
KEPT = 0.99  # Share of the drives' errors that a row has in common with the row before
FLOOR_NOISE = 0.005  # Torque by which wheels on a hard floor act against each other, over r W
MODEL_NOISE = 0.02  # Error of the model of a row, over the torque
#: Power of the density of a row: errors of the model are alike in rows beside each other.
POWER = 0.2
#: Largest torque of a wheel over its radius and the heaviest load of the table. No soil carries as
#: much: what is read above it is no torque, and is left out.
MOST_TORQUE = 10.0
TINY = 1e-12  # Smallest divisor
PAIRS = ((0, 0), (0, 1), (1, 1))  # Of means, whose covariances a belief has
OUTLIER, OUTLIER_STD = 0.01, 0.3  # Share of glitches, and their error over load and radius
#: Quantiles that are the ends of the 90 % interval, and the median. Those at 5 and 95 % covered
#: 79 % of the slips of 22 simulated drives with rims alike, these 90 %: rovers are driven to the
#: limit of a soil more often than soils of the prior have it, and a change of soil shows late.
QUANTILES = np.asarray([0.02, 0.5, 0.98])


@dataclass(frozen=True)
class Belief:
    """What is known after some rows: n grounds, k wheels."""

    weight: Floats  # Probability of each ground, (n,)
    mean: Floats  # Offset (N m) and gain of each wheel's torque, (2, n, k)
    cov: Floats  # Their variances and covariance: offset, both, gain, (3, n, k)
    apart: float = 0.0  # Variance of the rim speeds about their mean, over its square


@dataclass(frozen=True)
class SlipAnswer:
    """Answer for a row; three values are the ends of the 90 % interval and the median between."""

    speed: Floats  # (3,), m/s
    slip: Floats  # (3, k)
    soil: Floats  # (3, p), SI units
    no_soil: float  # Probability of a hard floor
    beyond: float  # Probability that the slip is above the largest of the table
    misfit: float  # Mean square of the residuals over their variance, 1 on average or less
    mean: float  # Of the speed, m/s
    std: float  # Standard deviation of the speed, m/s


class SlipFilter:
    r"""Slip and soil, row by row, from torque and the balance of forces.

    On each ground the wheels share one body speed v, at which they pull what the slope requires:

    .. math:: \sum_i DP_i(s_i, W_i) = m g (\sin\alpha + e), \quad s_i = 1 - v / (r_i \omega_i)

    (braking: r omega / v - 1), at the least slip where that is so. The torque of each wheel is read
    with an offset and a gain of its drive, both Gaussian and slowly varying:

    .. math:: y_i = (1 + g_i) T_i(s_i, W_i) + d_i + \epsilon_i

    Each ground is weighted by the density of its residuals. Another soil may follow at any row: the
    grounds then have the probabilities of the prior, and the drives keep their errors.

    Does not hold in turns, while the rover accelerates, or for wheels that are not driven.

    References: Wong, Theory of Ground Vehicles, chapters 2 and 3 (forces); Blom and Bar-Shalom,
    IEEE Trans. Automatic Control 33(8), 1988 (mixing of Gaussians where the model may change).
    """

    def __init__(
        self,
        table: ForceTable,
        weight: float,
        errors: DriveErrors,
        noise: tuple[float, float] = (0.0, 0.02),
    ) -> None:
        """`weight` of the rover, N; `noise` of a torque: N m, and a share of the reading."""
        self.table, self.weight, self.errors = table, weight, errors
        self.noise = noise
        n = table.pull.shape[2]
        rng, normal = np.random.default_rng(0), Prior.normal(1.0).at((np.arange(n) + 0.5) / n)
        self.share = errors.pull_std * rng.permutation(normal)
        self.of_row = rng.permutation(normal)
        soils = len(table.values)
        self._prior = np.where(table.floor, FLOOR_SHARE / max(n - soils, 1), 1.0 / soils)
        self._prior = self._prior / self._prior.sum()
        self._variances = [float(errors.loss_std**2), 0.0, float(errors.gain_std**2)]
        self.ratio = travel_ratio(table.slip)
        self.most_torque = MOST_TORQUE * table.load[-1] * table.radius  # (k,), N m

    def start(self) -> Belief:
        """The belief before any row."""
        size = len(self._prior), len(self.table.wheels)
        cov = np.asarray(self._variances)[:, None, None] * np.ones((3, *size))
        return Belief(self._prior, np.zeros((2, *size)), cov)

    def step(
        self, belief: Belief, rim_speed: Floats, torque: Floats, load: Floats, slope: float
    ) -> tuple[SlipAnswer, Belief]:
        """The answer for a row, and the belief after it.

        rim_speed: r omega of each wheel (k,), m/s, above zero.
        torque: Read torque of each wheel (k,), N m; NaN where there is none. One beyond
            `most_torque` is left out.
        load: Load of each wheel (k,), N, in the range of the table; beyond it that of its end.
        slope: Pitch, rad, positive uphill.
        """
        rim_speed, apart, kept = self.rims(np, np.asarray([belief.apart]), rim_speed)
        pull, own = self._curves(rim_speed, load)
        place, missing, rise = self._balance(pull, self.weight * (np.sin(slope) + self.share))
        at, rows = place.astype(np.int64), np.arange(len(place))
        error = self.weight * np.cos(slope) * self.errors.slope_std
        seen = np.abs(torque) <= self.most_torque
        weight, mean, cov, misfit = self.updated(
            np, (belief.weight[:, None], list(belief.mean), list(belief.cov)),
            reading=np.where(seen, torque, 0.0), seen=seen.astype(float), load=load,
            low=own[:, rows, at].T, high=own[:, rows, at + 1].T, share=place[:, None] % 1.0,
            rise=rise[:, None], step=np.diff(-self.ratio)[at, None], missing=missing[:, None],
            kept=kept, error=error,
        )  # fmt: skip
        moved = np.clip(place + error * self.of_row / rise, 0.0, len(self.ratio) - 1.0)
        ratio = np.interp(moved, np.arange(len(self.ratio)), self.ratio)
        after = Belief(weight[:, 0], np.stack(mean), np.stack(cov), float(apart[0]))
        speed = ratio * rim_speed.max()
        return self._answer(after.weight, speed, rim_speed, missing, float(misfit[0])), after

    def rims(self, ops: Any, apart: Any, rim_speed: Any) -> tuple[Any, Any, Any]:
        """Rim speeds shrunk to their mean, their variance about it, and the share kept of it.

        Where wheels turn alike, readings differ by noise alone, and torques do not follow it. Taken
        at face value, that noise would favour soils whose torque hardly changes with slip. The
        share is that of James and Stein (Efron and Morris, JASA 68, 1973).

        ops: As in `updated`.
        apart: Variance before the row, over the square of the mean, (1,).
        rim_speed: (k,).
        """
        middle = rim_speed.mean(axis=0, keepdims=True)
        away = rim_speed - middle
        now = squared(away / middle).sum(axis=0, keepdims=True)
        now = now * (1.0 / max(len(self.table.wheels) - 1, 1))
        apart = ops.where(apart > 0.0, apart * ROWS_ALIKE + now * (1.0 - ROWS_ALIKE), now)
        kept = 1.0 - float(self.errors.speed_std**2) / ops.maximum(apart, TINY)
        kept = ops.maximum(kept, 0.0)
        return middle + kept * away, apart, kept

    def _curves(self, rim_speed: Floats, load: Floats) -> tuple[Floats, Floats]:
        """Pull (n, m) of the rover, N, and torque (k, n, m) of its wheels, N m.

        At the body speeds at which the fastest wheel has the slips of the table.
        """
        table, own = self.table, []
        pull = np.zeros(table.pull.shape[2:])
        speed = rim_speed.max() * self.ratio
        for i, kind in enumerate(table.kind):
            slip = np.clip(slip_of_ratio(speed / rim_speed[i]), table.slip[0], table.slip[-1])
            left, a = _between(table.slip, slip)
            down, b = _between(np.log(table.load), np.log(load[i : i + 1]))
            j, c = int(down[0]), float(b[0])

            def at(values: Floats, kind: int = kind, j: int = j, c: float = c) -> Floats:
                return np.asarray((1.0 - c) * values[kind, j] + c * values[kind, j + 1])

            both = at(table.pull), at(table.torque)
            if np.ptp(rim_speed) > 0.0:
                soils = slice(len(table.values))  # wheels on a hard floor share its little slip
                for values in both:
                    own_slip = (1.0 - a) * values[soils, left] + a * values[soils, left + 1]
                    values[soils] = own_slip
            one, other = both
            pull += load[i] * one
            own.append(load[i] * table.radius[i] * other)
        return pull, np.asarray(own)

    def _balance(self, pull: Floats, needed: Floats) -> tuple[Floats, Floats, Floats]:
        """Place of the least slip that pulls enough, pull that is missing, rise to the next."""
        last = pull.shape[1] - 1
        enough = pull >= needed[:, None]
        known = enough.any(axis=1)
        after = np.where(known, np.maximum(np.argmax(enough, axis=1), 1), last)
        rows = np.arange(len(pull))
        low, high = pull[rows, after - 1], pull[rows, after]
        rise = np.maximum(high - low, 1e-3 * self.weight)
        share = np.where(known, np.clip((needed - low) / rise, 0.0, 1.0 - 1e-9), 1.0 - 1e-9)
        missing = np.where(known, 0.0, needed - pull.max(axis=1))
        return after - 1 + share, missing, rise

    def _mixed(self, weight: Any, mean: Any, cov: Any) -> tuple[Any, list[Any], list[Any]]:
        """Weights, means and covariances before a row, on which another soil may have begun."""
        stays = weight * (1.0 - CHANGE)
        mixed = stays + CHANGE * self._prior[:, None]
        same = stays / mixed
        other = 1.0 - same
        middle = [(weight * one).sum(axis=0, keepdims=True) for one in mean]
        apart = [one - of_all for one, of_all in zip(mean, middle, strict=True)]
        means = [(same * one + other * m) * KEPT for one, m in zip(mean, middle, strict=True)]
        covs = []
        for own, (i, j), begin in zip(cov, PAIRS, self._variances, strict=True):
            square = apart[i] * apart[j]
            pooled = (weight * (own + square)).sum(axis=0, keepdims=True)
            joint = same * own + other * pooled + same * other * square
            covs.append(joint * KEPT**2 + (1.0 - KEPT**2) * begin)
        return mixed, means, covs

    def updated(
        self, ops: Any, grounds: tuple[Any, Any, Any], *, reading: Any, seen: Any, load: Any,
        low: Any, high: Any, share: Any, rise: Any, step: Any, missing: Any, kept: Any, error: Any,
    ) -> tuple[Any, list[Any], list[Any], Any]:  # fmt: skip
        """Grounds after the torques of a row (Kalman's update on each), and misfit (1,).

        An error of the pitch changes the torques of all wheels together: a covariance of rank one
        beside that of each wheel.

        ops: Has `exp`, `log`, `maximum` and `where`: numpy, or, for values of a graph, the module
            `training.onnx_graph.value`. The formula is the same for both.
        grounds: Weights (n, 1), two means and three covariances (n, k) each, before the row.
        reading, seen, load: Read torques, 0 where there are none; 1 where there is one, else 0;
            loads, (k,).
        low, high: Torques at both ends of the interval of slips, (n, k).
        share, rise, step: Share of the way between them, and pull and travel between them, (n, 1).
        missing: Pull that no slip gives, N, (n, 1).
        kept: Of `rims`.
        error: Standard deviation of the force along the slope, N.
        """
        weight, mean, cov = self._mixed(*grounds)
        risen, floor = high - low, self.table.floor[:, None].astype(float)
        model = low + share * risen
        of_floor = squared(load * (FLOOR_NOISE * self.table.radius))
        spread = squared(risen / step * float(self.errors.speed_std)) * kept
        spread = spread * (1.0 - floor) + of_floor * floor
        constant, of_reading = self.noise
        noise = squared(reading) * float(of_reading**2 + MODEL_NOISE**2) + float(constant**2)
        gain = [cov[0] + cov[1] * model, cov[1] + cov[2] * model]
        variance = gain[0] + gain[1] * model + (noise + spread)
        residual = reading - float(self.errors.loss) - model - mean[0] - mean[1] * model
        common = risen / rise * error * seen
        precision = (common * common / variance).sum(axis=1, keepdims=True) + 1.0
        shared = (common * residual / variance).sum(axis=1, keepdims=True) / precision
        squares = (squared(residual) / variance * seen).sum(axis=1, keepdims=True)
        squares = squares - squared(shared) * precision
        volume = (ops.log(variance) * seen).sum(axis=1, keepdims=True)
        wide = squared(load * (OUTLIER_STD * self.table.radius))
        strange = ((squared(residual) / wide + ops.log(wide)) * seen).sum(axis=1, keepdims=True)
        glitch = strange * -0.5 + float(np.log(OUTLIER))
        sound = (squares + ops.log(precision) + volume) * -0.5 + float(np.log1p(-OUTLIER))
        larger = ops.maximum(sound, glitch)
        both = larger + ops.log(ops.exp(sound - larger) + ops.exp(glitch - larger))
        used = ops.exp(sound - both) * seen
        scale = float(1.0 / (self.errors.pull_std * self.weight))
        logs = both * POWER - squared(missing * scale) * 0.5 + ops.log(weight)
        after = ops.exp(logs - logs.max(axis=0, keepdims=True))
        after = after / after.sum(axis=0, keepdims=True)
        variance, left = variance + common * common / precision, residual - common * shared
        steps = [used * one / variance for one in gain]
        means = [one + own * left for one, own in zip(mean, steps, strict=True)]
        covs = [own - steps[i] * gain[j] for own, (i, j) in zip(cov, PAIRS, strict=True)]
        misfit = (after * squares).sum(axis=0, keepdims=True).reshape(1)
        return after, means, covs, misfit / ops.maximum(seen.sum(axis=0, keepdims=True), 1.0)

    def _answer(
        self, weight: Floats, speed: Floats, rim_speed: Floats, missing: Floats, misfit: float
    ) -> SlipAnswer:
        soils = len(self.table.values)
        slip = slip_of_ratio(speed[:, None] / rim_speed)
        of_row = weighted_quantiles(np.column_stack([speed, slip]), weight, QUANTILES)
        no_soil = float(weight[soils:].sum())
        of_soil = weight[:soils] / max(1.0 - no_soil, 1e-300)
        mean = float(weight @ speed)
        return SlipAnswer(
            of_row[:, 0],
            of_row[:, 1:],
            weighted_quantiles(self.table.values, of_soil, QUANTILES),
            no_soil,
            float(weight[missing > 0.0].sum()),
            misfit,
            mean,
            float(np.sqrt(weight @ (speed - mean) ** 2)),
        )


def travel_ratio(slip: Floats) -> Floats:
    """v / (r omega) from slip: 1 - s when driving, 1 / (1 + s) when braking."""
    return np.where(slip < 0.0, 1.0 / (1.0 + np.minimum(slip, 0.0)), 1.0 - slip)


def slip_of_ratio(ratio: Any, ops: Any = np) -> Any:
    """Slip from v / (r omega), with operations as in `SlipFilter.updated`."""
    return ops.where(ratio > 1.0, 1.0 / ops.maximum(ratio, 1.0) - 1.0, 1.0 - ratio)


def squared(x: Any) -> Any:
    """x times itself."""
    return x * x


def _between(nodes: Floats, values: Floats) -> tuple[np.ndarray, Floats]:
    """Position of the node below each value, and the share of the way to the next."""
    left = np.clip(np.searchsorted(nodes, values, side="right") - 1, 0, len(nodes) - 2)
    share = (values - nodes[left]) / (nodes[left + 1] - nodes[left])
    return left, np.clip(share, 0.0, 1.0)
