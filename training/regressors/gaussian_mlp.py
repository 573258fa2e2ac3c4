"""A multi-layer perceptron that predicts a mean and a variance."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from training.onnx_graph.builder import Graph
from training.regressors.gaussian_head import GaussianHead, validate_training_data
from training.regressors.gaussian_regressor import GaussianRegressor, Progress
from training.regressors.standardisation import Standardisation

Floats = NDArray[np.float64]

#: Penalty of AdamW on the weights: small, against growth without effect on the fit.
WEIGHT_DECAY = 1e-4
#: Norm to which larger gradients are scaled down, so that no batch with outliers disrupts the fit.
LARGEST_GRADIENT = 5.0
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
    layers_ : list of ndarray
        Weights and bias of each layer in turn; prediction does not need torch.
    history_ : list of (float, float)
        See `loss_history`.

    References
    ----------
    Nix and Weigend, Proc. IEEE ICNN, 1994.
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
        self.hidden = hidden
        self.epochs = epochs
        self.batch = batch
        self.learning_rate = learning_rate
        self.warm_up = warm_up
        self.patience = patience
        self.validation = validation
        self.random_state = random_state

    def fit(self, X: Any, y: Any) -> GaussianMLP:
        """Fit rows X (n, d) to y (n,) or (n, q); a share of them is used for early stopping."""
        return self._fit(X, y, None, lambda epoch, epochs: None)

    def fit_with_validation(
        self, X: Floats, y: Floats, validation: tuple[Floats, Floats], progress: Progress
    ) -> GaussianMLP:
        """Fit rows X (n, d) to y (n,) or (n, q), with separate validation rows (X, y)."""
        return self._fit(X, y, validation, progress)

    def _fit(
        self, X: Any, y: Any, validation: tuple[Floats, Floats] | None, progress: Progress
    ) -> GaussianMLP:
        X, Y, one_output = validate_training_data(self, X, y)
        if validation is None:
            order = np.random.default_rng(self.random_state).permutation(len(X))
            cut = max(int(self.validation * len(X)), 1) if len(X) > 1 else 0
            validation = (X[order[:cut]], Y[order[:cut]]) if cut else (X, Y)
            X, Y = X[order[cut:]], Y[order[cut:]]
        self.x_scaling_, self.y_scaling_ = Standardisation.of(X), Standardisation.of(Y)
        standardised = (
            self.x_scaling_.apply(validation[0]),
            self.y_scaling_.apply(validation[1].reshape(len(validation[1]), -1)),
        )
        x = self.x_scaling_.apply(X)
        self._minimise(x, self.y_scaling_.apply(Y), standardised, progress)
        log_variance = self._standardised_outputs(x)[1]
        self.head_ = GaussianHead.of(self.y_scaling_, log_variance, one_output)
        return self

    def _minimise(
        self, x: Floats, z: Floats, validation: tuple[Floats, Floats], progress: Progress
    ) -> None:
        import torch

        threads = torch.get_num_threads()
        torch.set_num_threads(1)  # sums in a fixed order, whatever the number of cores
        try:
            generator = torch.Generator().manual_seed(self.random_state)
            layers = _initial_layers([x.shape[1], *self.hidden, 2 * z.shape[1]], generator)
            self._run_epochs(torch, layers, generator, x, z, validation, progress)
        finally:
            torch.set_num_threads(threads)

    def _run_epochs(
        self,
        torch: Any,
        layers: list[Any],
        generator: Any,
        x: Floats,
        z: Floats,
        validation: tuple[Floats, Floats],
        progress: Progress,
    ) -> None:
        train_x, train_z = torch.from_numpy(x).float(), torch.from_numpy(z).float()
        validation_x, validation_z = (torch.from_numpy(part).float() for part in validation)
        batches = max(math.ceil(len(x) / self.batch), 1)
        optimiser = torch.optim.AdamW(layers, lr=self.learning_rate, weight_decay=WEIGHT_DECAY)
        schedule = torch.optim.lr_scheduler.CosineAnnealingLR(
            optimiser, max(self.epochs * batches, 1)
        )
        best, epochs_without_gain, self.history_ = math.inf, 0, []
        self.layers_ = _as_arrays(layers)
        for epoch in range(self.epochs):
            mean_only = epoch < self.warm_up * self.epochs
            order = torch.randperm(len(train_x), generator=generator)
            total = 0.0
            for index in order.split(self.batch):
                optimiser.zero_grad()
                outputs = _forward(torch, layers, train_x[index])
                loss = _loss(outputs, train_z[index], mean_only)
                loss.backward()
                torch.nn.utils.clip_grad_norm_(layers, LARGEST_GRADIENT)
                optimiser.step()
                schedule.step()
                total += float(loss.detach()) * len(index)
            with torch.no_grad():
                outputs = _forward(torch, layers, validation_x)
                validation_loss = float(_loss(outputs, validation_z, False))
            self.history_.append((total / len(train_x), validation_loss))
            progress(epoch + 1, self.epochs)
            if mean_only or validation_loss < best:
                best = math.inf if mean_only else validation_loss
                epochs_without_gain = 0
                self.layers_ = _as_arrays(layers)
            else:
                epochs_without_gain += 1
                if epochs_without_gain > self.patience:
                    break

    def _standardised_outputs(self, x: Floats) -> tuple[Floats, Floats]:
        h = x
        for weights, bias in self._layer_pairs()[:-1]:
            h = np.tanh(h @ weights + bias)
        weights, bias = self._layer_pairs()[-1]
        both = h @ weights + bias
        q = both.shape[1] // 2
        return both[:, :q], both[:, q:]

    def _layer_pairs(self) -> list[tuple[Floats, Floats]]:
        return list(zip(self.layers_[0::2], self.layers_[1::2], strict=True))

    def add_to_graph(self, graph: Graph, features: str) -> tuple[str, str]:
        """Add the fitted layers to an ONNX graph; names of mean and std, (n, q)."""
        h = graph.scaled(features, self.x_scaling_.mean, self.x_scaling_.scale)
        for weights, bias in self._layer_pairs()[:-1]:
            h = graph.op("Tanh", graph.affine(h, weights, bias))
        weights, bias = self._layer_pairs()[-1]
        both = graph.affine(h, weights, bias)
        q = weights.shape[1] // 2
        mean, log_variance = graph.columns(both, 0, q), graph.columns(both, q, 2 * q)
        return self.head_.add_to_graph(graph, mean, log_variance)

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


def _initial_layers(sizes: list[int], generator: Any) -> list[Any]:
    """Weights and biases: Glorot's uniform range, a tenth of it for the output layer."""
    import torch

    layers = []
    for i, (inward, outward) in enumerate(pairwise(sizes)):
        limit = math.sqrt(6.0 / (inward + outward)) * (0.1 if i == len(sizes) - 2 else 1.0)
        weights = (2.0 * torch.rand(inward, outward, generator=generator) - 1.0) * limit
        layers += [weights.requires_grad_(), torch.zeros(outward, requires_grad=True)]
    return layers


def _forward(torch: Any, layers: list[Any], h: Any) -> Any:
    """Outputs (n, 2 q) of inputs (n, d): means and log-variances."""
    for i in range(0, len(layers) - 2, 2):
        h = torch.tanh(h @ layers[i] + layers[i + 1])
    return h @ layers[-2] + layers[-1]


def _loss(outputs: Any, z: Any, mean_only: bool) -> Any:
    """Gaussian negative log likelihood per row, without constants; or half the squared error."""
    q = z.shape[1]
    squared_error = (z - outputs[:, :q]) ** 2
    if mean_only:
        return 0.5 * squared_error.sum(dim=1).mean()
    log_variance = outputs[:, q:].clamp(*LOG_VARIANCE_RANGE)
    return 0.5 * (log_variance + squared_error * (-log_variance).exp()).sum(dim=1).mean()


def _as_arrays(layers: list[Any]) -> list[Floats]:
    """Copies of weights and biases as float64 arrays."""
    return [part.detach().numpy().astype(np.float64) for part in layers]
