"""One dimensionless response surface serves wheels of all sizes."""

import numpy as np
import pytest

from training.onnx_graph.builder import Graph, session_of
from training.onnx_graph.value import Value
from training.set_posterior.validation import graph_outputs, posterior_session


def larger(sets, size):
    """The same sets, all lengths `size` times as large, at the same pressures."""
    force, moment = size**2, size**3
    for name in ("load", "drawbar_pull", "drawbar_pull_std"):
        sets.readings[name] *= force
    for name in ("torque", "torque_std", "torque_bias"):
        sets.readings[name] *= moment
    for name in ("sinkage", "sinkage_std"):
        sets.readings[name] *= size
    for name in ("wheel_radius", "wheel_width", "shear_modulus_max"):
        sets.context[name] *= size
    sets.context["bearing_modulus"] *= size ** -sets.context["n"]
    return sets


def test_estimates_scale_with_the_wheel_at_the_same_pressure(any_posterior):
    family, session = any_posterior.family, posterior_session(any_posterior)
    small, large = (family.sets(12, 6, 7) for _ in range(2))
    large = larger(large, 1.3)
    in_range = 0
    for index in range(len(small.truth)):
        a, b = (graph_outputs(session, any_posterior.response, s, index) for s in (small, large))
        assert a["set_in_range"] == b["set_in_range"]
        lengths = np.asarray([1.0, 1.0, 1.3])
        spread = a["set_std"] * lengths
        assert (np.abs(b["set_mean"] - a["set_mean"] * lengths) < 0.05 * spread).all()
        assert b["set_std"] == pytest.approx(spread, rel=0.05)
        in_range += bool(a["set_in_range"][0])
    assert in_range


@pytest.mark.slow
def test_features_in_the_graph_are_those_of_the_training(any_posterior):
    family = any_posterior.family
    sets = family.sets(10, 4, 3)
    names = [*sets.readings, *sets.context]
    graph = Graph()
    inputs = {name: Value(graph, name) for name in names}
    inputs |= {name: inputs[name].reshape(1, -1) for name in sets.readings}
    family.add_context(inputs).features.node("Identity").named("features")
    shapes = {n: ["rows"] if n in sets.readings else [1] for n in names}
    session = session_of(graph.model(shapes, {"features": (1, [5, "rows"])}))
    feed = {n: v.astype(np.float32) for n, v in sets.rows(2).items()}
    feed |= {n: np.asarray([v], np.float32) for n, v in sets.context_of(2).items()}
    wanted = family.features(sets.designs[2])
    (found,) = session.run(None, feed)
    assert pytest.approx(wanted, abs=2e-5) == found.T
