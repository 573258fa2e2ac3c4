"""Explanations in words: shares of errors of any size are one statement, and what they are not."""

from dataclasses import replace

import numpy as np
import pytest
from soilml.identification.presentation import Identification

from soilml import read_case, simulate
from soilml.fitting.coordinates import select_free
from soilml.identification.averaged import AveragedSamples, stated_explanations
from soilml.identification.fit import Fit, SoilExplanation
from soilml.numerics.importance_sampling import ImportanceSample
from soilml.traction import soil_draws

FOUND = (
    SoilExplanation("clogging", 0.25, 0.3),
    SoilExplanation("", 1.0, 0.21),
    SoilExplanation("", 2.0, 0.19),
    SoilExplanation("rate", 0.0, 0.1),
    SoilExplanation("rate", 0.25, 0.15),
    SoilExplanation("", 0.0, 0.05),
)


def fit_of(*explanations):
    return Fit("averaged", ("n",), ("1",), np.ones(1), np.eye(1), (), 3, explanations=explanations)


def test_shares_are_summed_over_the_sizes_of_errors_the_likeliest_first():
    stated = stated_explanations(FOUND)
    assert [str(one) for one in stated] == [
        "typical errors x 1 to 2",
        "clogging and typical errors x 0.25",
        "rate and typical errors x 0 to 0.25",
        "the model as in its file",
    ]
    assert [one.probability for one in stated] == pytest.approx([0.4, 0.3, 0.25, 0.05])
    assert "explained by: typical errors x 1 to 2 (40%), " in Identification(fit_of(*FOUND)).text()


def test_that_shares_test_no_effect_is_said_where_typical_errors_have_most():
    few, many = fit_of(*FOUND), fit_of(SoilExplanation("", 0.5, 0.6), SoilExplanation("", 0.0, 0.4))
    assert few.use_of_shares is None and "explanations_use" not in few.as_json()
    assert many.use_of_shares.code == many.as_json()["explanations_use"]["code"] == "shares-no-test"
    assert many.use_of_shares.text in Identification(many).text()
    assert fit_of().use_of_shares is None
    assert fit_of(SoilExplanation("", 0.0, 1.0)).use_of_shares is None


def test_pull_states_the_errors_of_all_sizes_together(model_file, monkeypatch):
    case = read_case(model_file)
    u = np.full((2, len(select_free(case, None))), 0.5)
    samples = AveragedSamples(
        ImportanceSample(u, np.full(2, 0.5), 0.0), 1.0, 1.0, explanations=FOUND[:5]
    )
    monkeypatch.setattr(soil_draws, "soil_samples", lambda *_: samples)
    soil = soil_draws.measured_soil(case, simulate(case, [0.1, 0.3], 60.0), None)
    (said,) = [w for w in soil.warnings if w.code == "against-model"]
    assert "(probability 0.40)" in said.text and said.about == ()
    alone = replace(samples, explanations=FOUND[:1])
    monkeypatch.setattr(soil_draws, "soil_samples", lambda *_: alone)
    soil = soil_draws.measured_soil(case, simulate(case, [0.1, 0.3], 60.0), None)
    assert [w.about for w in soil.warnings if w.code == "against-model"] == [("clogging",)]
