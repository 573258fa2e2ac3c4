"""The filter: which soils, and which slip on each, agree with the rows of a drive so far.

It needs numpy alone. The soils are those of a table made beforehand. Each has a probability, and
for each wheel a Gaussian of the losses of its drive, so that no soil is drawn again along the way.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

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
        n, k = table.pull.shape[2], len(table.wheels)
        rng, normal = np.random.default_rng(0), Prior.normal(1.0).at((np.arange(n) + 0.5) / n)
        self._share = errors.pull_std * rng.permutation(normal)
        self._row = rng.permutation(normal)
        soils = len(table.values)
        self._prior = np.where(table.floor, FLOOR_SHARE / max(n - soils, 1), 1.0 / soils)
        self._prior = self._prior / self._prior.sum()
        variances = [errors.loss_std**2, 0.0, errors.gain_std**2]
        self._cov = np.asarray(variances)[:, None, None] * np.ones((3, n, k))
        self._ratio = travel_ratio(table.slip)
        self.most_torque = MOST_TORQUE * table.load[-1] * table.radius  # (k,), N m

    def start(self) -> Belief:
        """The belief before any row."""
        n, k = self._cov.shape[1:]
        return Belief(self._prior, np.zeros((2, n, k)), self._cov)

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
        rim_speed, apart, kept = self._rims(belief.apart, rim_speed)
        pull, own = self._curves(rim_speed, load)
        place, missing, rise = self._balance(pull, self.weight * (np.sin(slope) + self._share))
        at, share = place.astype(np.int64), place % 1.0
        rows = np.arange(len(place))
        low, high = own[:, rows, at].T, own[:, rows, at + 1].T
        model = low + share[:, None] * (high - low)
        error = self.weight * np.cos(slope) * self.errors.slope_std
        common = (high - low) / rise[:, None] * error
        step = np.diff(-self._ratio)[at]
        spread = ((high - low) / step[:, None] * self.errors.speed_std) ** 2 * kept
        spread[len(self.table.values) :] = (FLOOR_NOISE * load * self.table.radius) ** 2
        weight, mean, cov = self._mixed(belief)
        after, misfit = self._weigh(
            weight, mean, cov, (torque, model, spread, common, load), missing
        )
        moved = np.clip(place + error * self._row / rise, 0.0, len(self._ratio) - 1.0)
        ratio = np.interp(moved, np.arange(len(self._ratio)), self._ratio)
        speed = ratio * rim_speed.max()
        answer = self._answer(after.weight, speed, rim_speed, missing, misfit)
        return answer, replace(after, apart=apart)

    def _rims(self, apart: float, rim_speed: Floats) -> tuple[Floats, float, float]:
        """Rim speeds shrunk to their mean, their variance about it, and the share kept of it.

        Where wheels turn alike, readings differ by noise alone, and torques do not follow it. Taken
        at face value, that noise would favour soils whose torque hardly changes with slip. The
        share is that of James and Stein (Efron and Morris, JASA 68, 1973).
        """
        middle = float(rim_speed.mean())
        now = float(np.var(rim_speed / middle, ddof=1)) if len(rim_speed) > 1 else 0.0
        apart = now if apart == 0.0 else ROWS_ALIKE * apart + (1.0 - ROWS_ALIKE) * now
        kept = max(1.0 - self.errors.speed_std**2 / apart, 0.0) if apart > 0.0 else 0.0
        return middle + kept * (rim_speed - middle), apart, kept

    def _curves(self, rim_speed: Floats, load: Floats) -> tuple[Floats, Floats]:
        """Pull (n, m) of the rover, N, and torque (k, n, m) of its wheels, N m.

        At the body speeds at which the fastest wheel has the slips of the table.
        """
        table, own = self.table, []
        pull = np.zeros(table.pull.shape[2:])
        speed = rim_speed.max() * self._ratio
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

    def _mixed(self, belief: Belief) -> tuple[Floats, Floats, Floats]:
        """Weights, means and covariances before a row, on which another soil may have begun."""
        w, mean, cov = belief.weight, belief.mean, belief.cov
        stays = (1.0 - CHANGE) * w
        weight = stays + CHANGE * self._prior
        same = (stays / weight)[:, None]
        middle = np.einsum("n,cnk->ck", w, mean)[:, None]
        apart = mean - middle
        squares = np.stack([apart[0] ** 2, apart[0] * apart[1], apart[1] ** 2])
        pooled = np.einsum("n,cnk->ck", w, cov + squares)[:, None]
        mean = same * mean + (1.0 - same) * middle
        cov = same * cov + (1.0 - same) * pooled + same * (1.0 - same) * squares
        return weight, KEPT * mean, KEPT**2 * cov + (1.0 - KEPT**2) * self._cov

    def _weigh(
        self,
        weight: Floats,
        mean: Floats,
        cov: Floats,
        row: tuple[Floats, Floats, Floats, Floats, Floats],
        missing: Floats,
    ) -> tuple[Belief, float]:
        """The belief after the torques of a row (Kalman's update on each ground), and misfit.

        An error of the pitch changes the torques of all wheels together, by `common` for each of
        its standard deviations: a covariance of rank one beside that of each wheel.
        """
        torque, model, spread, common, load = row
        seen = np.abs(torque) <= self.most_torque
        reading = np.where(seen, torque, 0.0)
        noise = self.noise[0] ** 2 + (self.noise[1] * reading) ** 2
        noise = noise + (MODEL_NOISE * reading) ** 2 + spread
        gain = np.stack([cov[0] + cov[1] * model, cov[1] + cov[2] * model])
        variance = gain[0] + gain[1] * model + noise
        residual = reading - self.errors.loss - model - mean[0] - mean[1] * model
        common = np.where(seen, common, 0.0)
        precision = 1.0 + (common**2 / variance).sum(axis=1)
        shared = (common * residual / variance).sum(axis=1) / precision
        squares = np.where(seen, residual**2 / variance, 0.0).sum(axis=1) - shared**2 * precision
        logs = -0.5 * (squares + np.log(precision))
        logs -= 0.5 * np.where(seen, np.log(variance), 0.0).sum(axis=1)
        wide = (OUTLIER_STD * load * self.table.radius) ** 2
        strange = np.where(seen, residual**2 / wide + np.log(wide), 0.0)
        glitch = np.log(OUTLIER) - 0.5 * strange.sum(axis=1)
        sound = np.log1p(-OUTLIER) + logs
        both = np.logaddexp(sound, glitch)
        used = np.exp(sound - both)[:, None] * seen
        logs = POWER * both - 0.5 * (missing / (self.errors.pull_std * self.weight)) ** 2
        logs = logs + np.log(weight)
        after = np.exp(logs - logs.max())
        after /= after.sum()
        variance = variance + common**2 / precision[:, None]
        step = used * gain / variance
        mean = mean + step * (residual - common * shared[:, None])
        cov = cov - np.stack([step[0] * gain[0], step[0] * gain[1], step[1] * gain[1]])
        misfit = float(after @ squares) / max(int(seen.sum()), 1)
        return Belief(after, mean, cov), misfit

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


def slip_of_ratio(ratio: Floats) -> Floats:
    """Slip from v / (r omega)."""
    return np.where(ratio > 1.0, 1.0 / np.maximum(ratio, 1.0) - 1.0, 1.0 - ratio)


def _between(nodes: Floats, values: Floats) -> tuple[np.ndarray, Floats]:
    """Position of the node below each value, and the share of the way to the next."""
    left = np.clip(np.searchsorted(nodes, values, side="right") - 1, 0, len(nodes) - 2)
    share = (values - nodes[left]) / (nodes[left + 1] - nodes[left])
    return left, np.clip(share, 0.0, 1.0)
