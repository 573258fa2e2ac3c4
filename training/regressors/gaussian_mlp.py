"""A multi-layer perceptron that predicts a mean and a variance."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from soilml.arrays import Floats
from training.onnx_graph.builder import Graph
from training.regressors.gaussian_regressor import GaussianRegressor, Progress
from training.regressors.tanh_network import TanhNetwork, evaluate_layers, layer_pairs

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
    epochs, batch, learning_rate : int, int, float
        Of AdamW with a cosine schedule.
    warm_up : float
        Share of the epochs in which the variance is fixed at 1, so that the mean is fitted first.
    patience : int
        Epochs without improvement on the validation rows after which training stops.
    validation : float
        Share of the rows used for validation, unless `fit_with_validation` is given some.
    random_state : int
        Seed of weights and batches.

    Attributes
    ----------
    layers_ : list
        Weights and bias of each layer in turn.
    history_ : list
        See `loss_history`.

    References: Nix and Weigend, Proc. IEEE ICNN, 1994.
    """

    type_name: ClassVar[str] = "mlp"

    def __init__(
        self,
        hidden: Sequence[int] = (64, 64),
        epochs: int = 40,
        batch: int = 256,
        learning_rate: float = 4e-3,
        warm_up: float = 0.1,
        patience: int = 15,
        validation: float = 0.1,
        random_state: int = 0,
    ) -> None:
        self.hidden, self.epochs, self.batch = hidden, epochs, batch
        self.learning_rate, self.warm_up = learning_rate, warm_up
        self.patience, self.validation, self.random_state = patience, validation, random_state

    def _set_aside(self, X: Floats, Y: Floats) -> tuple[Floats, Floats, Any]:
        """A share of the rows is for early stopping."""
        order = np.random.default_rng(self.random_state).permutation(len(X))
        cut = max(int(self.validation * len(X)), 1)
        return X[order[cut:]], Y[order[cut:]], (X[order[:cut]], Y[order[:cut]])

    def _fit_standardised(
        self, x: Floats, z: Floats, validation: tuple[Floats, Floats] | None, progress: Progress
    ) -> Floats:
        # one thread: sums in a fixed order; a step that is too long ends in infinities
        with threadpool_limits(1), np.errstate(over="ignore", invalid="ignore"):
            self._minimise(x, z, validation or (x, z), progress)
        return self._standardised_outputs(x)[1]

    def _minimise(
        self, x: Floats, z: Floats, validation: tuple[Floats, Floats], progress: Progress
    ) -> None:
        rng = np.random.default_rng(self.random_state)
        network = TanhNetwork([x.shape[1], *self.hidden, 2 * z.shape[1]], rng, FIRST_OUTPUTS)
        train_x, train_z = x.astype(np.float32), z.astype(np.float32)
        validation_x, validation_z = (part.astype(np.float32) for part in validation)
        steps = self.epochs * max(math.ceil(len(x) / self.batch), 1)
        best, epochs_without_gain, step, self.history_ = math.inf, 0, 0, []
        self.layers_ = network.layers()
        for epoch in range(self.epochs):
            mean_only = epoch < self.warm_up * self.epochs
            order, total = rng.permutation(len(x)), 0.0
            for first in range(0, len(x), self.batch):
                rows = order[first : first + self.batch]
                outputs = network.forward(train_x[rows])
                losses, slopes = _loss(outputs, train_z[rows], mean_only)
                network.backward(slopes)
                network.clip_gradient(LARGEST_GRADIENT)
                rate = 0.5 * self.learning_rate * (1.0 + math.cos(math.pi * step / steps))
                network.step(rate, WEIGHT_DECAY)
                total += float(losses.sum())
                step += 1
            losses, _ = _loss(network.forward(validation_x), validation_z, False)
            validation_loss = float(losses.mean())
            self.history_.append((total / len(x), validation_loss))
            progress(epoch + 1, self.epochs)
            if mean_only or validation_loss < best:
                best = math.inf if mean_only else validation_loss
                epochs_without_gain = 0
                self.layers_ = network.layers()
            else:
                epochs_without_gain += 1
                if epochs_without_gain > self.patience:
                    break

    def _standardised_outputs(self, x: Floats) -> tuple[Floats, Floats]:
        both = evaluate_layers(self.layers_, x)
        q = both.shape[1] // 2
        return both[:, :q], both[:, q:]

    def _add_standardised_outputs(self, graph: Graph, x: str) -> tuple[str, str]:
        *inner, (weights, bias) = layer_pairs(self.layers_)
        for inner_weights, inner_bias in inner:
            x = graph.op("Tanh", graph.affine(x, inner_weights, inner_bias))
        both, q = graph.affine(x, weights, bias), weights.shape[1] // 2
        return graph.columns(both, 0, q), graph.columns(both, q, 2 * q)

    def fitted_settings(self) -> str:
        """Layer widths, and epochs until training stopped."""
        layers = " x ".join(str(h) for h in self.hidden)
        return f"hidden {layers}, {len(self.history_)} epochs"

    def learning_curve_parameters(self) -> dict[str, Any] | None:
        """None: fitting again takes too long."""
        return None

    def mean_only_epochs(self) -> int:
        """Number of first epochs in which the variance is fixed."""
        return math.ceil(self.warm_up * self.epochs)

    def loss_history(self) -> list[tuple[float, float]]:
        """Training and validation loss of each epoch; squared error while the variance is fixed."""
        return self.history_


def _loss(outputs: Singles, z: Singles, mean_only: bool) -> tuple[Singles, Singles]:
    """Loss (n,) of each row, and derivatives (n, 2 q) of the mean loss by the outputs.

    The loss is the Gaussian negative log likelihood without constants, or half the squared error.
    """
    q = z.shape[1]
    error = outputs[:, :q] - z
    slopes = np.zeros_like(outputs)
    if mean_only:
        slopes[:, :q] = error / len(z)
        return 0.5 * (error**2).sum(axis=1), slopes
    log_variance = np.clip(outputs[:, q:], *LOG_VARIANCE_RANGE)
    precision = np.exp(-log_variance)
    squared = error**2 * precision
    inside = log_variance == outputs[:, q:]
    slopes[:, :q] = error * precision / len(z)
    slopes[:, q:] = 0.5 * (1.0 - squared) * inside / len(z)
    return 0.5 * (log_variance + squared).sum(axis=1), slopes
