"""The returned model is nearer to the fitted rows than the soil alone, or it is that."""

from types import SimpleNamespace

import numpy as np
import pytest

from soilml.gap.evidence.marginal_likelihood import Evidence
from soilml.gap.evidence.problem import MarginalFit
from soilml.gap.verdict import returned_model as module
from soilml.gap.verdict.returned_model import returned_model

MEASURED = np.asarray([1.0, 2.0, 3.0])
PROBLEM = SimpleNamespace(
    readings=SimpleNamespace(measured=MEASURED), covariance=SimpleNamespace(std=np.full(3, 0.1))
)
SOIL = SimpleNamespace(prediction=MEASURED + 0.3)


@pytest.fixture(autouse=True)
def no_lengths(monkeypatch):
    """The remainder at the readings is an amplitude of one channel."""
    monkeypatch.setattr(
        module, "with_fitted_lengths", lambda problem, marginal: (problem, marginal)
    )
    monkeypatch.setattr(module, "posterior_discrepancy", lambda _, m: m.evidence.amplitude[0])


def option(off, amplitude=0.0, effect=""):
    fit = SimpleNamespace(prediction=MEASURED + off, effects=[effect] if effect else [])
    size = np.asarray([amplitude])
    return MarginalFit(fit, Evidence(0.0, size, np.zeros(1), np.asarray([0.7])))


def test_an_explanation_that_scatter_cancels_is_not_written():
    far, near, alone = option(0.5, effect="drift"), option(0.2, effect="drift"), option(-0.8, 0.6)
    assert returned_model(PROBLEM, SOIL, (near, alone), False)[1] is near
    assert returned_model(PROBLEM, SOIL, (far, alone), False)[1] is alone  # 0.2 beside a remainder
    assert returned_model(PROBLEM, SOIL, (far,), True)[1] is far  # it is stated as the cause


@pytest.mark.parametrize("last", [option(0.1, 0.4), option(0.2)])
def test_else_it_is_the_soil_alone_with_the_uncertainty_of_a_remainder(last):
    """A remainder that leads away from the rows, or none at all."""
    written = returned_model(PROBLEM, SOIL, (option(0.5, effect="drift"), last), False)[1]
    assert written.fit is SOIL
    assert not written.evidence.amplitude.any()
    assert written.evidence.expected_amplitude == pytest.approx([0.7])
