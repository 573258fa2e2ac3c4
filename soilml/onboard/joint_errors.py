"""Fusion by the correlation of the errors of model files, which their held-out rows show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from soilml.onboard.fusion_rules import best_linear
from soilml.onboard.held_out_errors import HeldOutErrors
from soilml.onboard.set_contract import Floats
from soilml.quantities import Z_90

LEAST_COMMON_ROWS = 12  # Fewest held-out rows that two files must have in common
BINS = 6  # Intervals are calibrated by the fused mean, in so many bins of equal numbers of rows
#: With fewer common rows there are fewer bins, of so many rows or more; no gain is fitted, and the
#: interval is widened for a scale that is known from few rows.
MANY_ROWS, LEAST_ROWS_OF_BIN = 200, 40
#: Estimates that differ by more than this many standard deviations of their difference widen the
#: fused one in proportion: Birge's ratio, from which it would start at 1.
DISAGREEMENT = 2.0
LEAST_EIGENVALUE = 1e-3  # Least eigenvalue of a correlation matrix


@dataclass(frozen=True)
class JointErrors:
    r"""Rule for one quantity that m files estimate, measured on rows held out by all of them.

    .. math:: \min_w w^T S w, \quad S = D R D, \quad \sum_i w_i = 1, \quad w_i \ge 0

    where D holds the standard deviations of the row and R the correlation of the files'
    standardised errors. What a common soil does to two sensors, and the common prior, are part of
    these errors.

    correlation (m, m): R, about zero.
    centre, gain: The combination's distance from the centre is multiplied by the gain: each
        estimate is drawn towards the mean of the prior, and the combination of two is drawn too
        far.
    std_scale: Factor on the fused standard deviation, so that squared standardised errors average
        to 1.
    middles, low, high (bins,): Fused means, and the 5 % and 95 % quantiles of true value minus mean
        there, in fused standard deviations.

    References: Comin and Saaj 2017, eq. 26, is the case of independent errors. Bates and Granger,
    J. Oper. Res. Soc. 20(4), 1969. Birge, Phys. Rev. 40(2), 1932.
    """

    correlation: Floats
    centre: float
    gain: float
    std_scale: float
    middles: Floats
    low: Floats
    high: Floats

    def fuse(self, mean: Floats, std: Floats) -> tuple[Floats, Floats, Floats]:
        """Fused mean and standard deviation, and disagreement, (n,), of estimates (m, n).

        The disagreement is the largest difference between two files, in standard deviations of that
        difference.
        """
        disagreement = _disagreement(mean, std, self.correlation)
        fused = best_linear(mean, std, self.correlation)
        widening = np.maximum(1.0, disagreement / DISAGREEMENT)
        centre = self.centre + self.gain * (fused.mean - self.centre)
        return centre, self.std_scale * widening * fused.std, disagreement

    def interval(self, mean: Floats, std: Floats) -> tuple[Floats, Floats]:
        """Ends (n,) of the 90 % interval of fused means and standard deviations (n,)."""
        low, high = (np.interp(mean, self.middles, end) for end in (self.low, self.high))
        return mean + low * std, mean + high * std


@lru_cache(maxsize=64)
def joint_errors(files: tuple[HeldOutErrors, ...]) -> tuple[JointErrors, ...] | None:
    """Measure the rule for each quantity (q) of several files; None for too few common rows.

    Rows are common where number and true value agree; with fewer than `MANY_ROWS`, they must be
    half of a file's.
    """
    truth, mean, std = _common_rows(files)
    rows, fewest = len(truth), min(len(file.rows) for file in files)
    if rows < MANY_ROWS and rows < max(LEAST_COMMON_ROWS, fewest / 2):
        return None  # rows of other data agree by chance
    return tuple(_measure(truth[:, k], mean[..., k], std[..., k]) for k in range(truth.shape[1]))


def _common_rows(files: tuple[HeldOutErrors, ...]) -> tuple[Floats, Floats, Floats]:
    """True values (n, q), means and standard deviations (m, n, q) of the files' common rows.

    There are none where the files have different numbers of quantities.
    """
    common = files[0].rows
    for other in files[1:]:
        common = np.intersect1d(common, other.rows)
    if len({file.truth.shape[1] for file in files}) > 1:
        common = common[:0]
        files = files[:1]
    at = [np.searchsorted(file.rows, common) for file in files]
    truth, mean, std = (
        np.stack([getattr(file, key)[i] for file, i in zip(files, at, strict=True)])
        for key in ("truth", "mean", "std")
    )
    same = (truth == truth[0]).all(axis=(0, 2))
    return truth[0][same], mean[:, same], std[:, same]


def are_comparable(files: Sequence[HeldOutErrors | None]) -> bool:
    """Whether the correlation of the errors of these files is known: by enough common rows."""
    known = tuple(file for file in files if file is not None)
    return len(known) == len(files) and joint_errors(known) is not None


def _measure(truth: Floats, mean: Floats, std: Floats) -> JointErrors:
    """The rule from true values (n,) and estimates (m, n)."""
    z = (truth - mean) / std
    moments = z @ z.T
    size = np.sqrt(np.diag(moments))
    centre, none = float(truth.mean()), np.zeros(0)
    plain = JointErrors(_positive(moments / np.outer(size, size)), centre, 1.0, 1.0, *[none] * 3)
    away = plain.fuse(mean, std)[0] - centre
    few = len(truth) < MANY_ROWS
    gain = 1.0 if few else float(away @ (truth - centre) / (away @ away))
    together = replace(plain, gain=gain)
    fused, spread, _ = together.fuse(mean, std)
    scale = float(np.sqrt(np.mean(((truth - fused) / spread) ** 2)))
    residual = (truth - fused) / (scale * spread)
    bins = max(min(BINS, len(truth) // LEAST_ROWS_OF_BIN), 1) if few else BINS
    pieces = np.array_split(np.argsort(fused, kind="stable"), bins)
    rule = replace(
        together,
        std_scale=scale,
        middles=np.asarray([fused[piece].mean() for piece in pieces]),
        low=np.asarray([min(_quantile(residual[piece], 0.05), 0.0) for piece in pieces]),
        high=np.asarray([max(_quantile(residual[piece], 0.95), 0.0) for piece in pieces]),
    )
    # an interval that contains its mean, and is interpolated between bins, covers more than 90 %
    low, high = rule.interval(fused, scale * spread)
    side = np.maximum(np.where(truth < fused, fused - low, high - fused), 1e-9 * scale * spread)
    factor = _quantile(np.abs(truth - fused) / side, 0.9)
    if few:  # Student's 95 % quantile over the Gaussian one, to first order
        factor *= 1.0 + (Z_90**2 + 1.0) / (4.0 * (len(truth) - len(mean)))
    return replace(rule, low=factor * rule.low, high=factor * rule.high)


def _disagreement(mean: Floats, std: Floats, correlation: Floats) -> Floats:
    """Largest difference (n,) of two of m estimates, in standard deviations of the difference."""
    largest = np.zeros(mean.shape[1])
    for i in range(len(mean)):
        for j in range(i):
            variance = std[i] ** 2 + std[j] ** 2 - 2.0 * correlation[i, j] * std[i] * std[j]
            largest = np.maximum(largest, np.abs(mean[i] - mean[j]) / np.sqrt(variance))
    return largest


def _quantile(values: Floats, level: float) -> float:
    """The quantile whose expected coverage of a further value is `level` (Weibull's)."""
    return float(np.quantile(values, level, method="weibull"))


def _positive(correlation: Floats) -> Floats:
    """The correlation matrix (m, m) with eigenvalues above zero and ones on its diagonal."""
    values, vectors = np.linalg.eigh(correlation)
    repaired = (vectors * np.maximum(values, LEAST_EIGENVALUE)) @ vectors.T
    size = np.sqrt(np.diag(repaired))
    return np.asarray(repaired / np.outer(size, size))
