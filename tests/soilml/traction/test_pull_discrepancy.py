"""Draws of the error of the pull: as declared where nothing was measured, else as the residuals."""

from dataclasses import replace

import numpy as np
import pytest
from measured_rows import torque_rows

from soilml import read_case
from soilml.config.measurement_noise import Discrepancy, Noise
from soilml.traction import DrivenVehicle, performance
from soilml.traction.soil_draws import measured_soil

SOIL = {"cohesion": 900.0, "friction_angle": 0.6, "shear_modulus": 0.012}
SLIP, LOAD, ERROR, STATED = np.asarray([0.1, 0.3, 0.5]), np.full(3, 60.0), 0.4, 0.5
ALL = np.arange(400)


@pytest.fixture
def case(model_file):
    case = read_case(model_file)
    noise = {"torque_Nm": Noise(share=0.002), "drawbar_pull_N": Noise(constant=0.01)}
    return replace(case, noise=noise, discrepancy={"drawbar_pull_N": Discrepancy(constant=STATED)})


def drawn(case, *, with_pull):
    """Draws with errors, those of the prior, and the true pull, of torques measured at 60 N."""
    table = torque_rows(case, SOIL, SLIP, LOAD, more=["drawbar_pull_N"])
    pull = table.columns.pop("drawbar_pull_N")
    if with_pull:
        table.columns["drawbar_pull_N"] = pull + ERROR
    soil = measured_soil(case, table, exact_model=True)
    return *soil.with_errors(SLIP, [60.0, 2000.0], ("drawbar_pull",)), pull


def std_at(draws, load):
    error = draws.errors.at("drawbar_pull", "", ALL, np.full(400, 0.3), np.full(400, load))
    assert abs(error.mean()) < 0.2 * STATED or load == 60.0
    return error.std()


def pulled(case, draws):
    return performance(DrivenVehicle.of_wheel(case, 60.0), draws, np.zeros(0), SLIP)


def test_measured_pulls_tell_the_error_near_them_and_not_far_away(case):
    draws, before, pull = drawn(case, with_pull=True)
    near = pulled(case, draws).pull
    np.testing.assert_allclose(near.mean(axis=0), pull + ERROR, atol=0.02)
    assert (near.std(axis=0) < 0.03).all()
    assert std_at(draws, 2000.0) == pytest.approx(STATED, rel=0.12)
    assert std_at(before, 60.0) == pytest.approx(STATED, rel=0.12)


def test_the_error_widens_the_bands_of_pull_and_slope(case):
    draws, _, _ = drawn(case, with_pull=False)
    plain = pulled(case, replace(draws, errors=None))
    wide = pulled(case, draws)
    error = wide.pull - plain.pull
    assert error.std(axis=0) == pytest.approx(STATED, rel=0.15)
    best = np.arange(400), np.argmax(wide.pull, axis=1)
    steeper = 60.0 * (np.sin(wide.steepest_slope) - np.sin(plain.steepest_slope))
    assert np.corrcoef(steeper, error[best])[0, 1] > 0.9
