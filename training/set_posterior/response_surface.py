"""How a wheel answers, learned: coefficients of polynomials in the unknowns, by design."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from soilml.errors import InputError
from soilml.onboard.set_contract import RESPONSE_CHANNELS
from training.onnx_graph.value import Value, gemm, tanh
from training.regressors.standardisation import Standardisation
from training.set_posterior.monomials import Terms, monomial_terms, monomials
from training.set_posterior.wheel_family import WheelFamily

Floats = NDArray[np.float64]
Progress = Callable[[str, int, int], None]

#: Points of the unknowns at which each design is simulated, for each term of the polynomial.
POINTS_PER_TERM = 2.5
#: Nearly known axes are simulated within this many standard deviations of their widest.
NORMAL_TRUNCATION = 2.5
#: Designs simulated in one piece; batch of the descent; share held out.
PIECE, BATCH, HELD_OUT = 512, 256, 0.08
#: Weight of each channel's error in the fit.
WEIGHTS = np.asarray([1.0, 0.4, 1.0])


@dataclass(frozen=True)
class ResponseSettings:
    """How much is learned: designs simulated, width of the two hidden layers, epochs, seed."""

    designs: int
    hidden: int
    epochs: int
    seed: int


@dataclass(frozen=True)
class Response:
    r"""Channels of a row as polynomials whose coefficients a small network gives.

    .. math:: y_k(d, x) = \sum_j a_{kj}(d)\, b_j(x)

    With b monomials of the unknowns x and a(d) two tanh layers of the design's features. Rows of
    one soil share x: what they say of it adds up row by row, whatever their number and order.
    """

    terms: Terms
    scaling: Standardisation
    layers: tuple[Floats, ...]  # weights and biases in turn; the last gives (terms * channels)
    lower: Floats  # (f,) ends of the features that were learned from
    upper: Floats
    error: Floats  # (channels,) rms over designs not learned from, as the answers are

    def coefficients(self, features: Floats) -> Floats:
        """Coefficients (n, terms, channels) at features (n, f)."""
        h = self.scaling.apply(features)
        pairs = list(zip(self.layers[0::2], self.layers[1::2], strict=True))
        for weights, bias in pairs[:-1]:
            h = np.tanh(h @ weights + bias)
        weights, bias = pairs[-1]
        return np.asarray(h @ weights + bias).reshape(len(features), len(self.terms), -1)

    def predict(self, features: Floats, x: Floats) -> Floats:
        """Channels (n, m, channels) at features (n, f) and coordinates (n, m, p) or (m, p)."""
        return np.asarray(monomials(x, self.terms) @ self.coefficients(features))

    def add_coefficients(self, features: Value) -> Value:
        """Add the network to a graph: coefficients (channels * rows, terms + 1), float32.

        Rows are in the order of channels, then of readings; the last column is 0.
        """
        hidden = (features - self.scaling.mean) * (1.0 / self.scaling.scale)
        pairs = list(zip(self.layers[0::2], self.layers[1::2], strict=True))
        for weights, bias in pairs[:-1]:
            hidden = tanh(gemm(hidden, weights, bias))
        columns = len(self.terms) + 1
        weights, bias = (_by_channel(layer, columns - 1) for layer in pairs[-1])
        output = gemm(hidden, weights, bias).reshape(-1, len(RESPONSE_CHANNELS), columns)
        return output.node("Transpose", perm=[1, 0, 2]).reshape(-1, columns)


def _by_channel(layer: Floats, count: int) -> Floats:
    """The last layer with its outputs by channel first, then by term, and a term that is 0."""
    shape = layer.shape[:-1]
    own = layer.reshape(*shape, count, -1).swapaxes(-1, -2)
    return np.concatenate([own, np.zeros_like(own[..., :1])], axis=-1).reshape(*shape, -1)


def fit_response(family: WheelFamily, size: ResponseSettings, progress: Progress) -> Response:
    """Simulate designs at points of the unknowns, fit each by a polynomial, and learn terms.

    Raises `InputError` where fewer than half of the designs carry their load on all soils.
    """
    terms = monomial_terms(len(family.axes), family.degree[0], family.targets, family.degree[1])
    x = _points(family, int(POINTS_PER_TERM * len(terms)), size.seed)
    basis = monomials(x, terms)
    project = np.linalg.pinv(basis)
    designs = family.designs(size.designs, size.seed)
    found, left, answered = [], [], []
    for first in range(0, len(designs), PIECE):
        progress("simulating", first, len(designs))
        y = family.responses(designs[first : first + PIECE], x[None])
        whole = np.isfinite(y).all(axis=(1, 2))
        a = np.einsum("rp,npk->nrk", project, y[whole])
        found.append(a)
        left.append(np.mean((basis @ a - y[whole]) ** 2, axis=1))
        answered.append(whole)
    progress("simulating", len(designs), len(designs))
    kept = np.concatenate(answered)
    if kept.mean() < 0.5:
        raise InputError(
            f"only {kept.mean():.0%} of the ways to drive have an equilibrium on all soils of the "
            "prior: lower the loads, or raise the bearing values"
        )
    features = family.features(designs[kept])
    weigh = np.sqrt(np.mean(basis**2, axis=0))[:, None] * WEIGHTS
    wanted = np.concatenate(found)
    response = _fitted(terms, features, wanted, weigh, size, progress)
    unseen = slice(0, int(HELD_OUT * len(features)))
    off = basis @ (response.coefficients(features[unseen]) - wanted[unseen])
    surplus = np.concatenate(left)[unseen] * len(x) / (len(x) - len(terms))
    error = np.sqrt(np.mean(off**2, axis=(0, 1)) + surplus.mean(axis=0))
    return Response(terms, response.scaling, response.layers, response.lower, response.upper, error)


def _points(family: WheelFamily, count: int, seed: int) -> Floats:
    """Coordinates (count, p): spread over the prior, closer where an axis is nearly known."""
    from scipy.special import ndtri

    u = qmc.Sobol(len(family.axes), rng=seed).random(1 << (count - 1).bit_length())[:count]
    columns = [axis.quantile(u[:, i]) for i, axis in enumerate(family.axes[: family.free])]
    near = (
        np.clip(
            ndtri(np.clip(u[:, family.free :], 1e-9, 1.0 - 1e-9)),
            -NORMAL_TRUNCATION,
            NORMAL_TRUNCATION,
        )
        / NORMAL_TRUNCATION
    )
    return np.concatenate([np.stack(columns, axis=1), near], axis=1)


def _fitted(
    terms: Terms,
    features: Floats,
    wanted: Floats,
    weigh: Floats,
    size: ResponseSettings,
    progress: Progress,
) -> Response:
    """The network, by Adam with one rising and falling rate, on all but the held-out designs."""
    import torch

    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        generator = torch.Generator().manual_seed(size.seed)
        start = int(HELD_OUT * len(features))
        scaling = Standardisation.of(features)
        y = (wanted * weigh).reshape(len(wanted), -1)
        middle = y.mean(axis=0)
        spread = np.maximum(y.std(axis=0), 2e-3)
        x_train = torch.tensor(scaling.apply(features[start:]), dtype=torch.float32)
        y_train = torch.tensor((y[start:] - middle), dtype=torch.float32)
        gain = torch.tensor(spread, dtype=torch.float32)
        layers = _initial([features.shape[1], size.hidden, size.hidden, y.shape[1]], generator)
        steps = max(len(x_train) // BATCH, 1)
        optimiser = torch.optim.Adam(layers, lr=4e-3)
        rate = torch.optim.lr_scheduler.OneCycleLR(
            optimiser, 6e-3, total_steps=size.epochs * steps, pct_start=0.1
        )
        for epoch in range(size.epochs):
            progress("learning how wheels answer", epoch, size.epochs)
            order = torch.randperm(len(x_train), generator=generator)
            pieces: Any = torch.split(order[: steps * BATCH], BATCH)
            for rows in pieces:
                h = torch.tanh(x_train[rows] @ layers[0] + layers[1])
                h = torch.tanh(h @ layers[2] + layers[3])
                off = (h @ layers[4] + layers[5]) * gain - y_train[rows]
                loss: Any = (off**2).sum(dim=1).mean()
                optimiser.zero_grad()
                loss.backward()
                optimiser.step()
                rate.step()
        progress("learning how wheels answer", size.epochs, size.epochs)
        arrays = [layer.detach().numpy().astype(np.float64) for layer in layers]
    finally:
        torch.set_num_threads(threads)
    flat = weigh.reshape(-1)
    arrays[-2] = arrays[-2] * spread / flat
    arrays[-1] = (arrays[-1] * spread + middle) / flat
    ends = features.min(axis=0), features.max(axis=0)
    return Response(terms, scaling, tuple(arrays), *ends, np.zeros(len(RESPONSE_CHANNELS)))


def _initial(sizes: list[int], generator: Any) -> list[Any]:
    import torch

    layers: list[Any] = []
    for inward, outward in pairwise(sizes):
        limit = (6.0 / (inward + outward)) ** 0.5
        weights = (2.0 * torch.rand(inward, outward, generator=generator) - 1.0) * limit
        layers += [weights.requires_grad_(), torch.zeros(outward, requires_grad=True)]
    return layers
