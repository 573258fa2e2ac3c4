"""A multi-layer perceptron that predicts a mean and a variance."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from soilml.arrays import Floats
from training.onnx_graph.value import Tensor, halves
from training.regressors.gaussian_regressor import GaussianRegressor, Groups, Progress
from training.regressors.tanh_network import TanhNetwork, evaluate_layers

Singles = NDArray[np.float32]

#: Penalty of AdamW on the weights: small, against growth without effect on the fit.
WEIGHT_DECAY = 1e-4
#: Norm to which larger gradients are scaled down, so that no batch with outliers disrupts the fit.
LARGEST_GRADIENT = 5.0
FIRST_OUTPUTS = 0.1  # First weights of the output layer, as a share of those of the others
#: Log-variances of standardised outputs in the loss: standard deviations from 0.0025 to 20.
LOG_VARIANCE_RANGE = (-12.0, 6.0)


class GaussianMLP(GaussianRegressor):
    r"""Tanh layers with a Gaussian head, fitted by maximum likelihood.

    .. math:: L = \tfrac12 \sum_k \left[\log v_k + (y_k - \mu_k)^2 / v_k\right]

    Parameters
    ----------
    hidden : sequence of int
        Width of each hidden layer.
    epochs, steps, batch, learning_rate : int, int, int, float
        Of AdamW with a cosine schedule: at most so many passes over the rows, and at most so many
        steps of `batch` rows.
    warm_up : float
        Share of the steps in which the variance is fixed at 1, so that the mean is fitted first.
    random_state : int
        Seed of weights and batches.

    Attributes
    ----------
    layers_ : list
        Weights and bias of each layer in turn.

    References: Nix and Weigend, Proc. IEEE ICNN, 1994.
    """

    type_name: ClassVar[str] = "mlp"

    def __init__(
        self,
        hidden: Sequence[int] = (32, 32),
        epochs: int = 100,
        steps: int = 1500,
        batch: int = 512,
        learning_rate: float = 1.2e-2,
        warm_up: float = 0.1,
        random_state: int = 0,
    ) -> None:
        self.hidden, self.epochs, self.steps, self.batch = hidden, epochs, steps, batch
        self.learning_rate, self.warm_up = learning_rate, warm_up
        self.random_state = random_state

    def _fit_standardised(self, x: Floats, z: Floats, groups: Groups, progress: Progress) -> None:
        # one thread: sums in a fixed order; a step that is too long ends in infinities
        with threadpool_limits(1), np.errstate(over="ignore", invalid="ignore"):
            self._minimise(x, z, _row_weights(groups), progress)

    def _minimise(self, x: Floats, z: Floats, weights: Floats, progress: Progress) -> None:
        rng = np.random.default_rng(self.random_state)
        network = TanhNetwork([x.shape[1], *self.hidden, 2 * z.shape[1]], rng, FIRST_OUTPUTS)
        inputs, outputs, of_rows = (part.astype(np.float32) for part in (x, z, weights[:, None]))
        passes = math.ceil(len(x) / self.batch)
        steps, order = min(self.steps, self.epochs * passes), np.empty(0, np.int64)
        for step in range(steps):
            if len(order) < min(self.batch, len(x)):
                order = np.concatenate([order, rng.permutation(len(x))])
            rows, order = np.split(order, [self.batch])
            mean_only = step < self.warm_up * steps
            slopes = _slopes(network.forward(inputs[rows]), outputs[rows], mean_only)
            network.backward(slopes * of_rows[rows])
            network.clip_gradient(LARGEST_GRADIENT)
            rate = 0.5 * self.learning_rate * (1.0 + math.cos(math.pi * step / steps))
            network.step(rate, WEIGHT_DECAY)
            progress(step + 1, steps)
        self.layers_ = network.layers()

    def _standardised_outputs(self, x: Tensor) -> tuple[Tensor, Tensor]:
        mean, log_variance = halves(evaluate_layers(self.layers_, x))
        return mean, log_variance

    def fitted_settings(self) -> str:
        """Layer widths."""
        return f"hidden {' x '.join(str(h) for h in self.hidden)}"


def _row_weights(groups: Groups) -> Floats:
    r"""Weights (n,) of rows in the loss, :math:`1 / \sqrt{m}` for m rows of a group, of mean 1.

    Rows of a group say less than as many rows with errors of their own, and more than one.
    """
    _, code, count = np.unique(groups, return_inverse=True, return_counts=True)
    weight = 1.0 / np.sqrt(count[code])
    return np.asarray(weight / weight.mean())


def _slopes(outputs: Singles, z: Singles, mean_only: bool) -> Singles:
    """Derivatives (n, 2 q) of the mean loss by the outputs.

    The loss is the Gaussian negative log likelihood, or half the squared error.
    """
    q = z.shape[1]
    error = outputs[:, :q] - z
    slopes = np.zeros_like(outputs)
    if mean_only:
        slopes[:, :q] = error / len(z)
        return slopes
    log_variance = np.clip(outputs[:, q:], *LOG_VARIANCE_RANGE)
    precision = np.exp(-log_variance)
    inside = log_variance == outputs[:, q:]
    slopes[:, :q] = error * precision / len(z)
    slopes[:, q:] = 0.5 * (1.0 - error**2 * precision) * inside / len(z)
    return slopes
