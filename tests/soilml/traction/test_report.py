"""A missing effect hides from torque alone, and shows where sinkage is measured too."""

from dataclasses import replace

import numpy as np
import pytest
from measured_rows import torque_rows
from remarked import remarked

from soilml import SlipSinkage
from soilml.config.explanations import CaseExplanation
from soilml.config.measurement_noise import Noise
from soilml.traction import pull_report
from soilml.traction.soil_draws import measured_soil

pytestmark = pytest.mark.slow


def with_sinkage(case):
    return replace(case, model=case.model + SlipSinkage(n1=0.4))


def test_a_sinkage_that_the_model_cannot_explain_is_said_and_widens_the_band(case):
    case.noise["sinkage_m"] = Noise(constant=0.0005)
    truth = {"cohesion": 900.0, "friction_angle": 0.6, "shear_modulus": 0.012}
    found = {}
    for name, own in (("same", case), ("digging", with_sinkage(case))):
        rows = torque_rows(own, truth, [0.1, 0.3, 0.5], [40.0, 90.0, 60.0], more=["sinkage_m"])
        found[name] = pull_report(case, rows, loads=[60.0], slip_limit=0.5, exact_model=True)
    same, digging = found["same"], found["digging"]
    assert not remarked(same.warnings, "lacks an effect")
    assert remarked(digging.warnings, "lacks an effect")
    assert digging.by_load[0].remaining_fraction[0] > 2.0 * same.by_load[0].remaining_fraction[0]


def test_rows_that_speak_against_the_model_are_said_beside_its_bands(case):
    """The averaged soil accounts for the effect; the model that the bands are of lacks it."""
    case.noise["sinkage_m"] = Noise(constant=0.0005)
    slip, load = np.tile([0.1, 0.3, 0.5], 2), np.repeat([40.0, 90.0], 3)
    for digging in (False, True):
        own = with_sinkage(case) if digging else case
        rows = torque_rows(own, {}, slip, load, more=["sinkage_m"])
        rows.columns["run"] = np.repeat(["a", "b"], 3)
        soil = measured_soil(case, rows)
        assert ("against-model" in {w.code for w in soil.warnings}) == digging


@pytest.mark.parametrize("exact_model", [False, True])
def test_many_rows_are_thinned_as_by_identify(case, monkeypatch, exact_model):
    monkeypatch.setattr("soilml.fitting.readings.MOST_FITTED_ROWS", 4)
    rows = torque_rows(case, {}, np.tile([0.1, 0.3, 0.5], 2), np.repeat([40.0, 90.0], 3))
    soil = measured_soil(case, rows, exact_model=exact_model)
    assert soil.readings.row_count == 4 and "rows-thinned" in {w.code for w in soil.warnings}


def test_an_effect_of_a_stated_size_is_in_the_draws_of_its_explanation(case):
    both = tuple(CaseExplanation.of(0.5, one) for one in (case, with_sinkage(case)))
    rows = torque_rows(case, {}, [0.1, 0.3, 0.5], [40.0, 90.0, 60.0])
    draws = measured_soil(replace(case, explanations=both), rows).draws
    sizes = draws.values[:, draws.names.index("slip-sinkage.n1")]
    assert {*sizes.tolist()} == {0.0, 0.4}
