"""Draws of the error of the pull: as declared where nothing was measured, else as the residuals."""

from dataclasses import replace

import numpy as np
import pytest

from soilml import Operating, read_case
from soilml.config.measurement_noise import Discrepancy, Noise
from soilml.config.remainder import Remainder, RemainderPart
from soilml.io.table import Table
from soilml.traction.draws import SoilDraws
from soilml.traction.model_errors import draw_model_errors
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


def test_where_no_pull_was_measured_the_error_is_as_declared(case):
    amplitude, *both = drawn(case, rows(case), [60.0, 90.0])
    assert amplitude == pytest.approx(0.5, rel=0.01)
    for draws in both:
        assert draws.std(axis=0) == pytest.approx(0.5, rel=0.07)
        correlation = np.corrcoef(draws[:, 0, 0], draws[:, 1, 0])[0, 1]
        assert correlation == pytest.approx(np.exp(-0.5 * (np.log(1.5) / 0.6) ** 2), abs=0.05)


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


def test_a_share_is_of_the_measured_range_or_of_the_predicted_one(case):
    share = replace(case, discrepancy={"drawbar_pull_N": Discrepancy(share=0.02)})
    known = drawn(share, rows(case, error=0.0), [60.0])[0]
    predicted = drawn(share, rows(case), [60.0])[0]
    assert known == pytest.approx(predicted)
    assert known > 0.0


def test_a_learned_remainder_widens_with_the_distance_from_its_range(case):
    """Near its points it is known; far from them it has a usual error."""
    part = RemainderPart(
        "drawbar_pull_N", "", 0.2, 0.5, 0.3, 0.6, (0.1, 0.5), (60.0, 60.0),
        ((0.1, 60.0), (0.3, 60.0), (0.5, 60.0)), (1.0, 0.0, 0.0), np.eye(3).tolist(),
        np.zeros((3, 1)).tolist(),
    )  # fmt: skip
    learned = replace(case, remainder=Remainder((part,)), discrepancy={})
    amplitude, after, before = drawn(learned, rows(case), [60.0, 1200.0])
    assert amplitude == pytest.approx(0.5, rel=0.03)
    for draws in (after, before):
        assert draws[:, 0].std(axis=0).max() < 0.03
        assert draws[:, 1].std(axis=0) == pytest.approx(0.5, rel=0.07)


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
