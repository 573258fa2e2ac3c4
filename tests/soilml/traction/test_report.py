"""A missing effect hides from torque alone, and shows where sinkage is measured too."""

import numpy as np
import pytest
from remarked import remarked

from soilml import Operating, SlipSinkage
from soilml.config.measurement_noise import Noise
from soilml.io.table import Table
from soilml.traction.report import pull_report
from soilml.traction.soil_draws import measured_soil

pytestmark = pytest.mark.slow


def test_a_sinkage_that_the_model_cannot_explain_is_said_and_widens_the_band(case):
    case.noise["sinkage_m"] = Noise(constant=0.0005)
    truth = {"cohesion": 900.0, "friction_angle": 0.6, "shear_modulus": 0.012}
    true = case.with_values(truth)
    at = Operating(slip=np.asarray([0.1, 0.3, 0.5]), load=np.asarray([40.0, 90.0, 60.0]))
    found = {}
    for name, model in (("same", true.model), ("digging", true.model + SlipSinkage(n1=0.4))):
        force = model(true.soil, at)
        columns = {"run": np.full(3, "a"), "slip": at.slip, "load_N": at.load}
        columns |= {"torque_Nm": force.torque, "sinkage_m": force.sinkage}
        found[name] = pull_report(
            case, Table(columns), loads=[60.0], slip_limit=0.5, exact_model=True
        )
    same, digging = found["same"], found["digging"]
    assert not remarked(same.warnings, "lacks an effect")
    assert remarked(digging.warnings, "lacks an effect")
    assert digging.by_load[0].remaining_fraction[0] > 2.0 * same.by_load[0].remaining_fraction[0]


def test_rows_that_speak_against_the_model_are_said_beside_its_bands(case):
    """The averaged soil accounts for the effect; the model that the bands are of lacks it."""
    case.noise["sinkage_m"] = Noise(constant=0.0005)
    slip, load = np.tile([0.1, 0.3, 0.5], 2), np.repeat([40.0, 90.0], 3)
    columns = {"run": np.repeat(["a", "b"], 3), "slip": slip, "load_N": load}
    for digging in (False, True):
        model = case.model + SlipSinkage(n1=0.4) if digging else case.model
        force = model(case.soil, Operating(slip=slip, load=load))
        columns |= {"torque_Nm": force.torque, "sinkage_m": force.sinkage}
        soil = measured_soil(case, Table(columns))
        assert ("against-model" in {w.code for w in soil.warnings}) == digging
