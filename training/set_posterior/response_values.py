"""Values of a response surface in a graph."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.onboard.set_contract import RESPONSE_CHANNELS
from training.onnx_graph.value import Value, constant, gemm

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class SoilValues:
    """The last hidden layer (rows, hidden) of a network, and its last layer, bias included."""

    hidden: Value
    last_layer: Floats  # ((hidden + 1) * channels, terms) its weights

    @staticmethod
    def of(hidden: Value, last: tuple[Floats, ...], terms: int) -> SoilValues:
        """From the last hidden layer, and weights and bias of the last, of (terms * channels)."""
        layer = _by_channel(np.concatenate([last[0], last[1][None]]), terms)
        return SoilValues(hidden, layer.reshape(-1, terms))

    def at(self, basis: Value) -> Value:
        """Channels (rows, channels) at the soil with the monomials `basis` (terms, 1)."""
        last_layer = constant(basis.graph, self.last_layer)
        by_channel = (last_layer @ basis).reshape(-1, len(RESPONSE_CHANNELS))
        units = len(self.last_layer) // len(RESPONSE_CHANNELS) - 1
        weights, bias = by_channel.split([units, 1], axis=0)
        return self.hidden @ weights + bias


@dataclass(frozen=True)
class ResponseValues:
    """Graph values of a response surface for rows of readings, float32."""

    coefficients: Value  # (channels, rows, terms)
    tangent: Value  # (d, rows, hidden) derivatives of the last hidden layer along d directions
    last_layer: Floats  # (hidden * channels, terms) its weights

    @staticmethod
    def of(hidden: Value, tangent: Value, last: tuple[Floats, ...], terms: int) -> ResponseValues:
        """From the last hidden layer, and weights and bias of the last, of (terms * channels)."""
        weights, bias = (_by_channel(layer, terms) for layer in last)
        output = gemm(hidden, weights, bias).reshape(-1, len(RESPONSE_CHANNELS), terms)
        coefficients = output.node("Transpose", perm=[1, 0, 2])
        return ResponseValues(coefficients, tangent, weights.reshape(-1, terms))

    def slopes_at(self, basis: Value | None) -> Value:
        """Derivatives (d, channels, rows) of the channels at one soil along the directions.

        The soil is given by its monomials (terms, 1); None is the middle of the prior's range.
        """
        channels = len(RESPONSE_CHANNELS)
        if basis is None:
            by_channel: Value | Floats = self.last_layer[:, 0].reshape(-1, channels)
        else:
            last_layer = constant(basis.graph, self.last_layer)
            by_channel = (last_layer @ basis).reshape(-1, channels)
        return (self.tangent @ by_channel).node("Transpose", perm=[0, 2, 1])


def _by_channel(layer: Floats, terms: int) -> Floats:
    """The last layer with its outputs by channel first, then by term."""
    by_channel = layer.reshape(*layer.shape[:-1], terms, -1).swapaxes(-1, -2)
    return by_channel.reshape(*layer.shape[:-1], -1)
