"""The likelihood is averaged over scales of the model's errors, with their determinants."""

import numpy as np
import pytest
from scipy.special import logsumexp

from soilml.onboard.set_contract import INFERRED, MODEL_ERROR_COLUMNS
from training.onnx_graph.builder import Graph, session_of
from training.onnx_graph.value import Value, constant
from training.set_posterior.error_scales import GROUPS, USUAL_SCALES
from training.set_posterior.scale_mixture import integrate_out, scale_mixture

SIZES, PROBABILITIES = USUAL_SCALES.sizes, USUAL_SCALES.probabilities
JUDGED = 1  # The usual size

TERMS, ERRORS, ROWS, POINTS = 5, len(MODEL_ERROR_COLUMNS), 14, 6


@pytest.fixture(scope="module")
def session():
    graph = Graph()
    inputs = {name: Value(graph, name) for name in ("system", "size", "basis")}
    whole = inputs["system"].node("Unsqueeze", inputs["system"].indices([0]))
    system, errors = whole.last_columns(ERRORS)
    mixture = scale_mixture(system, errors, inputs["size"], USUAL_SCALES, (True,) * ERRORS)
    found = mixture.misfit(inputs["basis"], constant(graph, [1.0]))
    (found.log_likelihood * -2.0).named("surprise")
    found.least.node("Identity").named("least")
    (found.parts / found.total).named("shares")
    shapes = {"system": ["m", TERMS + ERRORS], "size": [1], "basis": [TERMS, POINTS]}
    outputs = {name: (1, ["k", POINTS]) for name in ("surprise", "least", "shares")}
    return session_of(graph.model(shapes, outputs))


@pytest.fixture
def example():
    rng = np.random.default_rng(0)
    system = rng.normal(size=(ROWS, TERMS + ERRORS)) * ([2.0] * TERMS + [0.7] * ERRORS)
    return system, rng.normal(size=(TERMS, POINTS))


def dense(system, basis, scale) -> tuple[np.ndarray, float]:
    """Misfit (points,) and logarithm of the determinant of the covariance."""
    residual, errors = system[:, :TERMS] @ basis, system[:, TERMS:] * scale
    covariance = np.eye(ROWS) + errors @ errors.T
    misfit = (residual * np.linalg.solve(covariance, residual)).sum(axis=0)
    return misfit, float(np.linalg.slogdet(covariance)[1])


def run(session, system, basis, size) -> list[np.ndarray]:
    feed = {"system": system, "size": np.full(1, size), "basis": basis}
    return session.run(None, {name: np.asarray(v, np.float32) for name, v in feed.items()})


def test_the_likelihood_is_the_average_over_scales(session, example):
    surprise, least, shares = run(session, *example, INFERRED)
    parts, misfits = [], []
    for scales, probability in zip(SIZES, PROBABILITIES, strict=True):
        misfit, log_determinant = dense(*example, np.repeat(scales, GROUPS))
        misfits.append(misfit)
        parts.append(np.log(probability) - 0.5 * (misfit + log_determinant))
    expected = logsumexp(parts, axis=0)
    assert surprise[0] == pytest.approx(-2.0 * expected, rel=1e-4)
    # the scale that is judged comes first
    parts = [parts[JUDGED], *(part for k, part in enumerate(parts) if k != JUDGED)]
    assert shares == pytest.approx(np.exp(np.asarray(parts) - expected), abs=1e-4)
    assert least[0] == pytest.approx(misfits[JUDGED], rel=1e-4)


def test_a_model_without_errors_takes_the_shortcut_to_the_same_likelihood(session, example):
    exact, nearly = (run(session, *example, size) for size in (0.0, 1e-5))
    assert exact[0] == pytest.approx(nearly[0], rel=1e-5)
    assert exact[1] == pytest.approx(nearly[1], rel=1e-5)
    assert (exact[2] == 1.0).all()


def test_common_errors_are_integrated_out_of_the_likelihood():
    rng = np.random.default_rng(0)
    a, g, b = rng.normal(size=(8, 5)), rng.normal(size=(8, 3)), rng.normal(size=5)
    graph = Graph()
    integrate_out(Value(graph, "system"), 3)[0].node("Identity").named("out")
    session = session_of(graph.model({"system": [1, "m", 8]}, {"out": (1, [1, "m", 5])}))
    system = np.concatenate([a, g], axis=1).astype(np.float32)
    found = session.run(None, {"system": system[None]})[0][0] @ b
    dense = np.linalg.solve(np.eye(8) + g @ g.T, a @ b)
    assert found @ found == pytest.approx((a @ b) @ dense, rel=1e-5)
    steady = np.concatenate([a, 0.0 * g], axis=1).astype(np.float32)
    assert session.run(None, {"system": steady[None]})[0][0] == pytest.approx(a, abs=1e-6)
