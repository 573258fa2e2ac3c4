"""Several regressors of the same row, fused into one estimate, in numpy and in an ONNX graph."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats
from soilml.onboard.fusion_rules import best_linear, shrink_correlation
from training.calibration.recalibration import CalibratedRegressor
from training.onnx_graph.value import Tensor, Value, concat, sqrt

#: Rows of which correlations are shrunk entirely; by a share of this number over theirs beyond.
SHRUNK_ROWS = 10.0


@dataclass(frozen=True)
class Ensemble:
    """Calibrated members, fused by the best linear combination for the covariance of their errors.

    One set of weights is for all rows: weights of each row would favour the member that happens to
    be overconfident there.
    """

    members: tuple[CalibratedRegressor, ...]
    correlation: Floats  # (q, m, m) between the members' errors
    weights: Floats  # (m, q)

    def predict(self, features: Floats, return_std: bool = True) -> tuple[Floats, Floats]:
        """Mean and standard deviation (n, q) before recalibration."""
        means, stds = zip(*(member.predict(features) for member in self.members), strict=True)
        return self.combine(means, stds)

    def add_to_graph(self, features: Value) -> tuple[Value, Value]:
        """Add all members and their combination to an ONNX graph; mean and std, (n, q)."""
        means, stds = [], []
        for member in self.members:
            mean, std = member.regressor.add_to_graph(features)
            means.append(mean)
            stds.append(std * member.std_scale)
        return self.combine(means, stds)

    def combine(self, means: Sequence[Tensor], stds: Sequence[Tensor]) -> tuple[Tensor, Tensor]:
        r"""Mean and standard deviation (n, q) from those of the m members.

        .. math:: \mu = \sum_i w_i \mu_i, \qquad
            \sigma^2 = \sum_i \sum_j w_i w_j \sigma_i \sigma_j \rho_{ij}
        """
        m, q = self.weights.shape
        # one product sums estimates, and one the products of all pairs of their standard deviations
        quantity, columns = np.arange(q), np.arange(m * q).reshape(m, q)
        first, second = np.triu_indices(m)
        multiplicity = np.where(first == second, 1.0, 2.0)  # the pairs (i, j) and (j, i)
        of_pairs = np.zeros((len(first), q, q))
        of_pairs[:, quantity, quantity] = (
            self.weights[first] * self.weights[second]
            * self.correlation[:, first, second].T * multiplicity[:, None]
        )  # fmt: skip
        std_of_all = concat(stds, axis=1)  # (n, m q)
        left, right = (
            std_of_all.take(columns[k].ravel().tolist(), axis=1) for k in (first, second)
        )
        variance = (left * right) @ of_pairs.reshape(-1, q)
        of_estimates = (self.weights[:, :, None] * np.eye(q)).reshape(-1, q)
        return concat(means, axis=1) @ of_estimates, sqrt(variance)


def fuse_members(
    members: list[CalibratedRegressor], mean: Floats, std: Floats, truth: Floats
) -> Ensemble:
    """Fuse members by the covariance of their errors.

    mean, std (m, n, q): Their estimates of rows that they have not seen, whose true values are
        `truth` (n, q).
    """
    error = truth - mean
    z = error / std
    rmse = np.sqrt(np.mean(error**2, axis=1))
    m, _, q = error.shape
    share = min(0.1, SHRUNK_ROWS / len(truth))
    correlation = np.stack(
        [shrink_correlation(np.corrcoef(z[:, :, k]).reshape(m, m), share) for k in range(q)]
    )
    weights = np.stack(
        [best_linear(rmse[:, k], rmse[:, k], correlation[k]).weights for k in range(q)], axis=1
    )
    return Ensemble(tuple(members), correlation, weights)
