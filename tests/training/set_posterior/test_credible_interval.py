"""Ends of the interval of a weighted sample."""

import numpy as np
import pytest
from scipy.stats import norm

from training.onnx_graph.builder import Graph, session_of
from training.onnx_graph.value import Value
from training.set_posterior.posterior_summary import add_quantiles

SAMPLES = 400


def ends_of(deviations, weights):
    """Ends (q, 2) by the graph, of deviations (q, n) and weights (n,) with sum 1."""
    q, graph = len(deviations), Graph()
    std = np.sqrt((weights * deviations**2).sum(axis=1))
    feed = {"deviations": deviations, "std": std, "weights": weights[None]}
    given = [Value(graph, name) for name in feed]
    add_quantiles(*given).node("Identity").named("ends")
    shapes = {name: list(value.shape) for name, value in feed.items()}
    session = session_of(graph.model(shapes, {"ends": (1, [2, q])}))
    return session.run(None, {k: v.astype(np.float32) for k, v in feed.items()})[0].T / std[:, None]


def test_the_ends_are_the_quantiles_of_a_weighted_sample():
    # evenly spaced over ten standard deviations, with the weights of a normal density
    z = np.linspace(-5.0, 5.0, SAMPLES)
    weights = norm.pdf(z) / norm.pdf(z).sum()
    skewed = np.exp(0.3 * z) - (weights * np.exp(0.3 * z)).sum()
    found = ends_of(np.stack([2.0 * z, skewed]), weights)
    assert found[0] == pytest.approx(norm.ppf([0.05, 0.95]), abs=0.02)
    exact = np.interp([0.05, 0.95], np.cumsum(weights) - 0.5 * weights, skewed)
    assert found[1] == pytest.approx(exact / np.sqrt((weights * skewed**2).sum()), abs=0.03)
