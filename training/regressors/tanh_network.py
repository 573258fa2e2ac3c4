"""A small network with tanh layers and its training by Adam, in numpy.

Networks here have some thousand weights and batches of some hundred rows: the arithmetic of a step
takes less time than what an automatic differentiation library spends on keeping records.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from training.onnx_graph.value import Tensor, affine, tanh

Singles = NDArray[np.float32]

#: Decay rates of Adam's moments, and what is added to the root of the second.
FIRST_DECAY, SECOND_DECAY, EPSILON = 0.9, 0.999, 1e-8


class TanhNetwork:
    r"""Layers :math:`h \mapsto \tanh(h W + b)`, the last without tanh, in single precision.

    sizes: Number of inputs, of units of each hidden layer, and of outputs.
    generator: Of the first weights, uniform in Glorot's range.
    last_share: Share of that range for the last layer.

    References: Glorot and Bengio, AISTATS 2010 (first weights); Kingma and Ba, ICLR 2015 (Adam);
    Loshchilov and Hutter, ICLR 2019 (decay of the weights).
    """

    def __init__(
        self, sizes: Sequence[int], generator: np.random.Generator, last_share: float = 1.0
    ) -> None:
        shapes = [shape for pair in pairwise(sizes) for shape in (pair, pair[1:])]
        count = sum(int(np.prod(shape)) for shape in shapes)
        self._flat, self._gradient = np.zeros(count, np.float32), np.zeros(count, np.float32)
        self._first, self._second = np.zeros(count, np.float32), np.zeros(count, np.float32)
        self._scratch = np.empty(count, np.float32)
        self._layers = _views(self._flat, shapes)
        self._gradients = _views(self._gradient, shapes)
        self._outputs: list[Singles] = []
        self._steps = 0
        for k, (weights, _) in enumerate(self._layers):
            share = last_share if k == len(self._layers) - 1 else 1.0
            limit = share * (6.0 / sum(weights.shape)) ** 0.5
            weights[...] = generator.uniform(-limit, limit, weights.shape)

    def layers(self) -> list[Floats]:
        """Copies of the weights and biases of each layer in turn, in double precision."""
        return [part.astype(np.float64) for layer in self._layers for part in layer]

    def forward(self, x: Singles) -> Singles:
        """Outputs (n, q) of inputs (n, d); the hidden layers are kept for `backward`."""
        self._outputs = [x]
        for weights, bias in self._layers[:-1]:
            hidden = self._outputs[-1] @ weights
            hidden += bias
            np.tanh(hidden, out=hidden)
            self._outputs.append(hidden)
        weights, bias = self._layers[-1]
        return np.asarray(self._outputs[-1] @ weights + bias)

    def backward(self, slope: Singles) -> None:
        """Gradient of the loss, from its derivatives (n, q) by the outputs of `forward`."""
        for k in reversed(range(len(self._layers))):
            into = self._outputs[k]
            weights, bias = self._gradients[k]
            np.matmul(into.T, slope, out=weights)
            np.sum(slope, axis=0, out=bias)
            if k:
                slope = slope @ self._layers[k][0].T
                np.multiply(into, into, out=into)
                np.subtract(1.0, into, out=into)
                slope *= into

    def clip_gradient(self, most: float) -> None:
        """Scale a gradient down whose norm is larger."""
        norm = float(np.sqrt(self._gradient @ self._gradient))
        if norm > most:
            self._gradient *= most / norm

    def step(self, rate: float, weight_decay: float = 0.0) -> None:
        """A step of Adam along the gradient, with decoupled decay of the weights."""
        self._steps += 1
        scratch = self._scratch
        self._first *= FIRST_DECAY
        np.multiply(self._gradient, 1.0 - FIRST_DECAY, out=scratch)
        self._first += scratch
        self._second *= SECOND_DECAY
        np.multiply(self._gradient, self._gradient, out=scratch)
        scratch *= 1.0 - SECOND_DECAY
        self._second += scratch
        np.sqrt(self._second, out=scratch)
        scratch *= 1.0 / (1.0 - SECOND_DECAY**self._steps) ** 0.5
        scratch += EPSILON
        np.divide(self._first, scratch, out=scratch)
        scratch *= rate / (1.0 - FIRST_DECAY**self._steps)
        if weight_decay:
            self._flat *= 1.0 - rate * weight_decay
        self._flat -= scratch


def evaluate_layers(layers: Sequence[Floats], x: Tensor) -> Tensor:
    """Outputs (n, q) of inputs (n, d) in double precision, by `TanhNetwork.layers`."""
    *inner, last = zip(layers[0::2], layers[1::2], strict=True)
    for layer in inner:
        x = tanh(affine(x, *layer))
    return affine(x, *last)


def _views(flat: Singles, shapes: Sequence[tuple[int, ...]]) -> list[tuple[Singles, Singles]]:
    """Weights and biases of each layer as parts of a vector."""
    ends = np.cumsum([int(np.prod(shape)) for shape in shapes])
    parts = [
        part.reshape(shape) for part, shape in zip(np.split(flat, ends[:-1]), shapes, strict=True)
    ]
    return list(zip(parts[0::2], parts[1::2], strict=True))


#: Learning rates of the one-cycle schedule: the first, the largest, which is reached after a tenth
#: of the steps, and the last.
FIRST_RATE, LARGEST_RATE, LAST_RATE, WARM_UP = 2.4e-4, 6e-3, 2.4e-8, 0.1


def one_cycle_rate(done: float) -> float:
    """Learning rate at a share of the steps: half a cosine up, and a longer one down to nothing.

    References: Smith and Topin, arXiv:1708.07120, 2017.
    """
    if done < WARM_UP:
        start, end, share = FIRST_RATE, LARGEST_RATE, done / WARM_UP
    else:
        start, end, share = LARGEST_RATE, LAST_RATE, (done - WARM_UP) / (1.0 - WARM_UP)
    return end + 0.5 * (start - end) * (1.0 + math.cos(math.pi * share))
