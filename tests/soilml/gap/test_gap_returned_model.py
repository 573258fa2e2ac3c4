"""The returned model is nearer to the fitted rows than the soil alone, or it is that."""

from types import SimpleNamespace

import numpy as np
import pytest
from gap_sets import case_of, driven

from soilml.gap import workflow
from soilml.gap.evidence.marginal_likelihood import Evidence
from soilml.gap.evidence.problem import MarginalFit
from soilml.gap.verdict import returned_model as module
from soilml.gap.verdict.returned_model import returned_model
from soilml.physics.effects import EFFECTS

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


@pytest.mark.parametrize("nearer", [True, False])
def test_the_likeliest_of_a_class_is_returned_as_suspected_or_not_at_all(monkeypatch, nearer):
    """The report has its size in both cases; the last option is the soil alone."""

    def one_of(problem, soil, options, stated):
        assert not stated and len(options) == 2
        return problem, options[0 if nearer else 1]

    monkeypatch.setattr(workflow, "returned_model", one_of)
    case = case_of()
    report = workflow.gap(case, driven(case, [EFFECTS["bulldozing"](share=0.05)]))
    assert report.status == "class" and report.effects[0].name == "bulldozing"
    assert [e.name for e in report.model.model.effects] == ["bulldozing"] * nearer
    assert report.model.suspected == ("bulldozing",) * nearer
    share = report.effects[0].parameters["share"]
    assert share.value == pytest.approx(0.05, abs=0.02)
