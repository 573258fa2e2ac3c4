"""Draws of the error of the pull: as declared where nothing was measured, else as the residuals."""

from dataclasses import replace

import numpy as np
import pytest

from soilml import Operating, read_case
from soilml.config.measurement_noise import Discrepancy, Noise
from soilml.io.table import Table
from soilml.traction.draws import SoilDraws, draw_model_errors
from soilml.traction.pull_and_slope import predict_traction

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


def drawn(case, table, loads, *, slips=SLIP, noise_scale=1.0):
    """Largest standard deviation of the pull, and errors (2000, loads, slips) after and before."""
    found = draw_model_errors(
        case, table, SAME_SOIL, SLIP, loads, channels=("drawbar_pull",), noise_scale=noise_scale
    )
    draw, load, slip = (
        g.ravel() for g in np.meshgrid(np.arange(2000), loads, slips, indexing="ij")
    )
    shape = 2000, len(loads), len(slips)
    after, before = (f.at("drawbar_pull", "", draw, slip, load).reshape(shape) for f in found)
    return found[1].amplitude("drawbar_pull"), after, before


def test_measured_pulls_tell_the_error_near_them_and_not_far_away(case):
    table = rows(case, error=0.4)
    _, after, before = drawn(case, table, [60.0, 2000.0])
    near, far = after[:, 0], after[:, 1]
    assert near.mean(axis=0) == pytest.approx(0.4, abs=0.02)
    assert (near.std(axis=0) < 0.02).all()
    assert far.mean(axis=0) == pytest.approx(0.0, abs=0.05)
    assert far.std(axis=0) == pytest.approx(0.5, rel=0.07)
    assert before[:, 0].std(axis=0) == pytest.approx(0.5, rel=0.07)
    without = drawn(case, table, [60.0], noise_scale=None)[1]
    assert without.std(axis=0) == pytest.approx(0.5, rel=0.07)


def test_the_error_widens_the_bands_of_pull_and_slope(case):
    declared = replace(case, discrepancy={"drawbar_pull_N": Discrepancy(constant=2.0)})
    after, _ = draw_model_errors(declared, rows(case), SAME_SOIL, SLIP, [60.0])
    draws = SoilDraws(NAMES, SAME_SOIL.values, after).of_draws(np.arange(200))
    plain = predict_traction(case, replace(draws, errors=None), 60.0, SLIP)
    wide = predict_traction(case, draws, 60.0, SLIP)
    error = wide.pull - plain.pull
    assert error.std(axis=0) == pytest.approx(2.0, rel=0.2)
    slope = wide.slope[:, 1]
    assert 60.0 * np.sin(slope).std() == pytest.approx(2.0, rel=0.3)
    assert np.corrcoef(slope, error[:, 1])[0, 1] > 0.99
