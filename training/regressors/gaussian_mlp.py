"""The multi-layer perceptron that predicts a mean and a variance."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from sklearn.base import BaseEstimator, MultiOutputMixin, RegressorMixin
from sklearn.utils.validation import check_is_fitted, validate_data

from training.onnx_graph.builder import Graph
from training.regressors.gaussian_head import GaussianHead, checked
from training.regressors.standardisation import Standardisation

Floats = NDArray[np.float64]
Progress = Callable[[int], None]


class GaussianMLP(MultiOutputMixin, RegressorMixin, BaseEstimator):  # type: ignore[misc]
    r"""Tanh layers with a Gaussian head, by maximum likelihood.

    .. math:: L = \tfrac12 \sum_k \left[\log v_k + (y_k - \mu_k)^2 / v_k\right]

    Parameters
    ----------
    hidden : sequence of int
        Width of each hidden layer.
    epochs, batch, learning_rate : int, int, float
        Of AdamW with a cosine schedule.
    warm_up : float
        Share of the epochs in which the variance is held, so that the mean is found first.
    patience : int
        Epochs without improvement on the held-out rows after which training stops.
    validation : float
        Share of the rows held out, unless `fit` is given some.
    random_state : int
        Seed of weights and batches.

    References: Nix and Weigend, Proc. IEEE ICNN, 1994. Weights are kept as numpy arrays: a fitted
    machine needs torch no more.
    """

    kind: ClassVar[str] = "mlp"

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

    def fit(
        self,
        X: Any,
        y: Any,
        held_out: tuple[Floats, Floats] | None = None,
        progress: Progress = lambda epoch: None,
    ) -> GaussianMLP:
        """Fit rows X (n, d) to y (n,) or (n, q); stops early on `held_out` rows (X, y)."""
        X, Y, one_output = checked(self, X, y)
        if held_out is None:
            order = np.random.default_rng(self.random_state).permutation(len(X))
            cut = max(int(self.validation * len(X)), 1) if len(X) > 1 else 0
            held_out = (X[order[:cut]], Y[order[:cut]]) if cut else (X, Y)
            X, Y = X[order[cut:]], Y[order[cut:]]
        self.x_scaling_, self.y_scaling_ = Standardisation.of(X), Standardisation.of(Y)
        standardised = (
            self.x_scaling_.apply(held_out[0]),
            self.y_scaling_.apply(held_out[1].reshape(len(held_out[1]), -1)),
        )
        x = self.x_scaling_.apply(X)
        self._descend(x, self.y_scaling_.apply(Y), standardised, progress)
        self.head_ = GaussianHead.of(self.y_scaling_, self._outputs(x)[1], one_output)
        return self

    def _descend(
        self, x: Floats, z: Floats, held_out: tuple[Floats, Floats], progress: Progress
    ) -> None:
        import torch

        threads = torch.get_num_threads()
        torch.set_num_threads(1)  # same sums in the same order, and no fight over two cores
        try:
            generator = torch.Generator().manual_seed(self.random_state)
            layers = _initial([x.shape[1], *self.hidden, 2 * z.shape[1]], generator)
            self._epochs(torch, layers, generator, x, z, held_out, progress)
        finally:
            torch.set_num_threads(threads)

    def _epochs(
        self,
        torch: Any,
        layers: list[Any],
        generator: Any,
        x: Floats,
        z: Floats,
        held_out: tuple[Floats, Floats],
        progress: Progress,
    ) -> None:
        q = z.shape[1]
        tx, tz = torch.from_numpy(x).float(), torch.from_numpy(z).float()
        hx, hz = (torch.from_numpy(part).float() for part in held_out)
        batches = max(math.ceil(len(x) / self.batch), 1)
        optimiser = torch.optim.AdamW(layers, lr=self.learning_rate, weight_decay=1e-4)
        schedule = torch.optim.lr_scheduler.CosineAnnealingLR(
            optimiser, max(self.epochs * batches, 1)
        )
        best, waited, self.history_ = math.inf, 0, []
        self.layers_ = [part.detach().numpy().astype(np.float64) for part in layers]
        for epoch in range(self.epochs):
            holding = epoch < self.warm_up * self.epochs
            order = torch.randperm(len(tx), generator=generator)
            total = 0.0
            for index in order.split(self.batch):
                optimiser.zero_grad()
                loss = _loss(_forward(torch, layers, tx[index]), tz[index], q, holding)
                loss.backward()
                torch.nn.utils.clip_grad_norm_(layers, 5.0)
                optimiser.step()
                schedule.step()
                total += float(loss.detach()) * len(index)
            with torch.no_grad():
                check = float(_loss(_forward(torch, layers, hx), hz, q, False))
            self.history_.append((total / len(tx), check))
            progress(epoch + 1)
            if holding or check < best:
                best, waited = (math.inf if holding else check), 0
                self.layers_ = [part.detach().numpy().astype(np.float64) for part in layers]
            else:
                waited += 1
                if waited > self.patience:
                    break

    def predict(self, X: Any, return_std: bool = False) -> Any:
        """Mean (n,) or (n, q); with `return_std` a tuple with the standard deviation."""
        check_is_fitted(self)
        X = validate_data(self, X, reset=False, dtype=np.float64)
        return self.head_.answer(*self._outputs(self.x_scaling_.apply(X)), return_std)

    def _outputs(self, h: Floats) -> tuple[Floats, Floats]:
        """Mean and log-variance (n, q) in standardised outputs, from standardised inputs."""
        for weights, bias in self._pairs()[:-1]:
            h = np.tanh(h @ weights + bias)
        weights, bias = self._pairs()[-1]
        both = h @ weights + bias
        q = both.shape[1] // 2
        return both[:, :q], both[:, q:]

    def _pairs(self) -> list[tuple[Floats, Floats]]:
        return list(zip(self.layers_[0::2], self.layers_[1::2], strict=True))

    def draw(self, graph: Graph, features: str) -> tuple[str, str]:
        """The fitted layers as nodes of an ONNX graph: names of mean and std, (n, q)."""
        h = graph.scaled(features, self.x_scaling_.mean, self.x_scaling_.scale)
        for weights, bias in self._pairs()[:-1]:
            h = graph.op("Tanh", graph.affine(h, weights, bias))
        weights, bias = self._pairs()[-1]
        both = graph.affine(h, weights, bias)
        q = weights.shape[1] // 2
        return self.head_.draw(graph, graph.columns(both, 0, q), graph.columns(both, q, 2 * q))


def _initial(sizes: list[int], generator: Any) -> list[Any]:
    """Weights and biases: Glorot's uniform range, the output layer near zero."""
    import torch

    layers = []
    for i, (inward, outward) in enumerate(pairwise(sizes)):
        limit = math.sqrt(6.0 / (inward + outward)) * (0.1 if i == len(sizes) - 2 else 1.0)
        weights = (2.0 * torch.rand(inward, outward, generator=generator) - 1.0) * limit
        layers += [weights.requires_grad_(), torch.zeros(outward, requires_grad=True)]
    return layers


def _forward(torch: Any, layers: list[Any], h: Any) -> Any:
    for i in range(0, len(layers) - 2, 2):
        h = torch.tanh(h @ layers[i] + layers[i + 1])
    return h @ layers[-2] + layers[-1]


def _loss(both: Any, z: Any, q: int, holding: bool) -> Any:
    square = (z - both[:, :q]) ** 2
    if holding:
        return 0.5 * square.sum(dim=1).mean()
    logs = both[:, q:].clamp(-12.0, 6.0)
    return 0.5 * (logs + square * (-logs).exp()).sum(dim=1).mean()
