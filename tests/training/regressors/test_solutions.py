"""Solutions in tiles and in parts are those at once; gradients are those of differences."""

import numpy as np
import pytest
from test_regressors import curve

from soilml.processes import limited_workers
from training.regressors import nystrom_features
from training.regressors.lssvm import LSSVM
from training.regressors.tanh_network import TanhNetwork


@pytest.mark.slow
def test_the_fixed_size_solution_in_parts_is_that_of_all_rows_at_once(monkeypatch):
    x, y, _ = curve(3000)
    once = LSSVM(centres=40).fit(x, y)
    monkeypatch.setattr(nystrom_features, "CHUNK", 256)
    found = []
    for threads in (1, 3):
        with limited_workers(threads):
            found.append(LSSVM(centres=40).fit(x, y).predict(x, return_std=True))
    for one, three, whole in zip(*found, once.predict(x, return_std=True), strict=True):
        np.testing.assert_array_equal(one, three)  # whatever the number of threads
        np.testing.assert_allclose(one, whole, rtol=1e-5, atol=1e-7)


@pytest.mark.slow
def test_rows_of_one_soil_do_not_mislead_where_they_are_left_out_together():
    rng = np.random.default_rng(0)
    x = np.repeat(rng.uniform(-2.0, 2.0, (80, 1)), 10, axis=0) + 0.01 * rng.normal(size=(800, 1))
    shared = np.repeat(rng.normal(size=(80, 1)), 10, axis=0)  # what the rows of a soil share
    y = np.sin(2.0 * x) + shared
    other = rng.uniform(-2.0, 2.0, (400, 1))
    truth = np.sin(2.0 * other)
    regressor = LSSVM(centres=60)
    misled = np.sqrt(np.mean((regressor.fit(x, y).predict(other) - truth) ** 2))
    regressor.fit_left_out(x, y, np.repeat(np.arange(80), 10), lambda done, total: None)
    assert np.sqrt(np.mean((regressor.predict(other) - truth) ** 2)) < 0.75 * misled


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
