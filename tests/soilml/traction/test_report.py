"""A missing effect hides from torque alone, and shows where sinkage is measured too."""

from dataclasses import replace

import numpy as np
import pytest
from remarked import remarked

from soilml import Operating, SlipSinkage, read_case, simulate
from soilml.config.measurement_noise import Noise
from soilml.config.remainder import Remainder, RemainderPart
from soilml.io.table import Table
from soilml.traction.report import pull_report
from soilml.traction.soil_draws import measured_soil

pytestmark = pytest.mark.slow


@pytest.fixture
def case(model_file):
    return read_case(model_file)


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


def test_the_soil_of_rows_is_drawn_without_a_remainder_that_they_taught(case):
    """Its mean shifts the pull of every draw all the same."""
    rows = simulate(case, np.tile([0.1, 0.2, 0.3, 0.4], 3), np.repeat([40.0, 70.0, 100.0], 4))
    others = simulate(case, rows["slip"], rows["load_N"], seed=7)
    part = RemainderPart(
        "drawbar_pull_N", "", 2.0, 2.0, 0.3, 0.6, (0.1, 0.4), (40.0, 100.0),
        ((0.2, 70.0),), (1.0,), ((1.0,),), ((0.0,),),
    )  # fmt: skip
    torque = replace(part, column="torque_Nm", amplitude=0.2, usual=0.2)
    learned = replace(case, remainder=Remainder((part, torque)).of_rows(rows))
    plain = replace(case, remainder=None)

    def drawn(own, table, **options):
        soil = measured_soil(own, table, ["friction_angle"], **options)
        return soil.draws.values.tolist(), "same-rows" in {w.code for w in soil.warnings}

    assert drawn(learned, rows) == (drawn(plain, rows)[0], True)
    assert drawn(learned, others)[0] != drawn(plain, others)[0]
    assert drawn(learned, rows, exact_model=True)[0] != drawn(plain, rows, exact_model=True)[0]
    options = {"free": ["friction_angle"], "loads": [70.0], "slip_limit": 0.4}
    pulls = [pull_report(own, rows, **options).by_load[0].posterior for own in (learned, plain)]
    k = int(np.argmin(np.abs(pulls[0].slip - 0.2)))
    added = np.median(pulls[0].pull[:, k]) - np.median(pulls[1].pull[:, k])
    assert added == pytest.approx(2.0, rel=0.1)
