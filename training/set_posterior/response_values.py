"""Values of a response surface in a graph."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.onboard.set_contract import RESPONSE_CHANNELS
from training.onnx_graph.value import Value, concat, constant, gemm

Floats = NDArray[np.float64]
CHANNELS = len(RESPONSE_CHANNELS)


@dataclass(frozen=True)
class SoilValues:
    """The last hidden layer (hidden, rows) of a network, and its last layer, bias included."""

    hidden: Value
    last_layer: Floats  # (channels * (hidden + 1), terms) its weights

    @staticmethod
    def of(hidden: Value, last: tuple[Floats, ...], terms: int) -> SoilValues:
        """From the last hidden layer, and weights and bias of the last, of (terms * channels)."""
        return SoilValues(hidden, _by_channel(np.concatenate([last[0], last[1][None]]), terms))

    def at(self, basis: Value) -> Value:
        """Channels (channels, rows) at the soil with the monomials `basis` (terms, 1)."""
        by_channel = (constant(basis.graph, self.last_layer) @ basis).reshape(CHANNELS, -1)
        units = len(self.last_layer) // CHANNELS - 1
        weights, bias = by_channel.split([units, 1], axis=1)
        return gemm(weights, self.hidden, bias)


@dataclass(frozen=True)
class ResponseValues:
    """Graph values of a response surface for rows of readings, float32.

    A reading is one channel of one row; readings are numbered by channel, and then by row.
    """

    coefficients: Value  # (terms, readings), with the offset taken off the constant term
    tangent: Value  # (d, hidden, rows) derivatives of the last hidden layer along d directions
    last_layer: Floats  # (channels * hidden, terms) its weights

    @staticmethod
    def of(
        hidden: Value, offset: Value, tangent: Value, last: tuple[Floats, ...], terms: int
    ) -> ResponseValues:
        """From the last hidden layer, and weights and bias of the last, of (terms * channels)."""
        weights, bias = last
        # the constant term is the first of each channel
        of_offset = -np.eye(terms * CHANNELS, CHANNELS)
        layer = constant(hidden.graph, np.concatenate([weights.T, of_offset], axis=1))
        output = gemm(layer, concat([hidden, offset], axis=0), bias[:, None])
        return ResponseValues(output.reshape(terms, -1), tangent, _by_channel(weights, terms))

    def slopes_at(self, basis: Value | None) -> Value:
        """Derivatives (d, channels, rows) of the channels at one soil along the directions.

        The soil is given by its monomials (terms, 1); None is the middle of the prior's range.
        """
        if basis is None:
            return self.last_layer[:, 0].reshape(CHANNELS, -1) @ self.tangent
        last_layer = constant(basis.graph, self.last_layer)
        return (last_layer @ basis).reshape(CHANNELS, -1) @ self.tangent


def _by_channel(layer: Floats, terms: int) -> Floats:
    """Weights (units, terms * channels) of a last layer as (channels * units, terms)."""
    return layer.reshape(len(layer), terms, CHANNELS).transpose(2, 0, 1).reshape(-1, terms)
