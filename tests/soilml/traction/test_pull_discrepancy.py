"""Draws of the error of the pull: as declared where nothing was measured, else as the residuals."""

from dataclasses import replace

import numpy as np
import pytest

from soilml import Operating, read_case
from soilml.config.measurement_noise import Discrepancy, Noise
from soilml.io.table import Table
from soilml.traction.pull_and_slope import draw_pull_discrepancy, predict_traction
from soilml.traction.soil_draws import SoilDraws

NAMES = ("cohesion", "friction_angle", "shear_modulus")
SAME_SOIL = SoilDraws(NAMES, np.tile([900.0, 0.6, 0.012], (2000, 1)))
SLIP, LOAD = np.asarray([0.1, 0.3, 0.5]), np.full(3, 60.0)


@pytest.fixture
def case(model_file):
    case = read_case(model_file)
    noise = case.noise | {"drawbar_pull_N": Noise(constant=0.01)}
    return replace(case, noise=noise, discrepancy={"drawbar_pull_N": Discrepancy(constant=0.5)})


def rows(case, error=None):
    """Rows on the soil of the draws; with an error, N, their pulls were measured."""
    true = case.with_values(dict(zip(NAMES, SAME_SOIL.values[0], strict=True)))
    pull = true.model(true.soil, Operating(slip=SLIP, load=LOAD)).drawbar_pull
    measured = {} if error is None else {"drawbar_pull_N": pull + error}
    return Table({"slip": SLIP, "load_N": LOAD, **measured})


def test_where_no_pull_was_measured_the_error_is_as_declared(case):
    found = draw_pull_discrepancy(case, rows(case), SAME_SOIL, [60.0, 90.0], SLIP)
    assert found.amplitude == 0.5
    for draws in (found.posterior, found.prior):
        assert draws.shape == (2000, 2, 3)
        assert draws.std(axis=0) == pytest.approx(0.5, rel=0.07)
        correlation = np.corrcoef(draws[:, 0, 0], draws[:, 1, 0])[0, 1]
        assert correlation == pytest.approx(np.exp(-0.5 * (np.log(1.5) / 0.6) ** 2), abs=0.05)


def test_measured_pulls_tell_the_error_near_them_and_not_far_away(case):
    table = rows(case, error=0.4)
    found = draw_pull_discrepancy(case, table, SAME_SOIL, [60.0, 2000.0], SLIP)
    near, far = found.posterior[:, 0], found.posterior[:, 1]
    assert near.mean(axis=0) == pytest.approx(0.4, abs=0.02)
    assert (near.std(axis=0) < 0.02).all()
    assert far.mean(axis=0) == pytest.approx(0.0, abs=0.05)
    assert far.std(axis=0) == pytest.approx(0.5, rel=0.07)
    assert found.prior[:, 0].std(axis=0) == pytest.approx(0.5, rel=0.07)
    without = draw_pull_discrepancy(case, table, SAME_SOIL, [60.0], SLIP, noise_scale=None)
    assert without.posterior.std(axis=0) == pytest.approx(0.5, rel=0.07)


def test_a_share_is_of_the_measured_range_or_of_the_predicted_one(case):
    share = replace(case, discrepancy={"drawbar_pull_N": Discrepancy(share=0.02)})
    known = draw_pull_discrepancy(share, rows(case, error=0.0), SAME_SOIL, [60.0], SLIP)
    predicted = draw_pull_discrepancy(share, rows(case), SAME_SOIL, [60.0], SLIP)
    assert known.amplitude == pytest.approx(predicted.amplitude)
    assert known.amplitude > 0.0


def test_none_is_drawn_where_none_is_declared(case):
    torque_only = replace(case, discrepancy={"torque_Nm": Discrepancy(share=0.02)})
    assert draw_pull_discrepancy(torque_only, rows(case), SAME_SOIL, [60.0], SLIP) is None


def test_the_error_widens_the_bands_of_pull_and_slope(case):
    draws = SoilDraws(NAMES, SAME_SOIL.values[:50])
    error = np.random.default_rng(1).normal(0.0, 2.0, (50, 1)) * np.ones(3)
    plain = predict_traction(case, draws, 60.0, SLIP)
    wide = predict_traction(case, draws, 60.0, SLIP, pull_error=error)
    assert wide.pull == pytest.approx(plain.pull + error)
    slope = wide.slope[:, 1]
    assert 60.0 * np.sin(slope).std() == pytest.approx(2.0, rel=0.3)
    assert np.argmax(slope) == np.argmax(error[:, 1])
