"""The network's gradient and steps, against differences and by hand."""

import numpy as np
import pytest

from training.regressors.tanh_network import TanhNetwork


def test_the_gradient_is_that_of_differences():
    rng = np.random.default_rng(0)
    x, y = (rng.normal(size=(20, k)).astype(np.float32) for k in (3, 2))
    network = TanhNetwork([3, 8, 7, 2], rng)
    network.backward(network.forward(x) - y)
    layers = network.layers()

    def loss(parts):
        h = x.astype(np.float64)
        for weights, bias in zip(parts[0:-2:2], parts[1:-2:2], strict=True):
            h = np.tanh(h @ weights + bias)
        return 0.5 * np.sum((h @ parts[-2] + parts[-1] - y) ** 2)

    gradients = [part for layer in network._gradients for part in layer]
    for k, part in enumerate(layers):
        for index in list(np.ndindex(part.shape))[::5]:
            shifted = [[p.copy() for p in layers] for _ in range(2)]
            shifted[0][k][index] += 1e-5
            shifted[1][k][index] -= 1e-5
            slope = (loss(shifted[0]) - loss(shifted[1])) / 2e-5
            assert gradients[k][index] == pytest.approx(slope, rel=1e-3, abs=1e-4)
