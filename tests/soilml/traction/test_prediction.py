"""What a wheel pulls and climbs on soils that are known, and how sure one can be."""

import numpy as np
import pytest
from remarked import remarked

from soilml import DrawbarOffset, LoadTransfer, Operating, SlipSinkage
from soilml.config.case import Case
from soilml.remarks import texts
from soilml.traction import SoilDraws, predict_traction, quantile_band
from soilml.traction.measured_range import MeasuredRange
from soilml.traction.pull_and_slope import predictions_by_load

SLIPS = np.asarray([0.1, 0.3, 0.6])
EVERYWHERE = MeasuredRange((0.0, 0.99), (1.0, 1e4))
NAMES = ("cohesion", "friction_angle", "shear_modulus")


def soils(*rows):
    return SoilDraws(NAMES, np.asarray(rows, dtype=float))


def with_effect(case, effect):
    return Case(case.model + effect, case.soil, case.prior, case.noise)


def test_on_the_climbed_slope_the_pull_equals_the_component_of_the_load(case):
    rng = np.random.default_rng(3)
    draws = soils(*zip(*[p.at(rng.random(50)) for p in case.prior.values()], strict=True))
    found = predict_traction(case, draws, 80.0, SLIPS)
    soil = draws.of(case, np.arange(50)[:, None])
    at = Operating(slip=SLIPS, load=80.0 * np.cos(found.slope))
    pull = soil.model(soil.soil, at).drawbar_pull
    np.testing.assert_allclose(pull, 80.0 * np.sin(found.slope), atol=1e-6)
    assert (found.slope < 0.0).any()  # some soils at some slips: downhill only


def test_effects_of_the_soil_count_and_those_of_rig_and_sensors_do_not(case):
    one = soils((900.0, 0.6, 0.012))
    plain = predict_traction(case, one, 60.0, SLIPS)
    for effect in (DrawbarOffset(offset=3.0), LoadTransfer(offset=20.0)):
        seen = with_effect(case, effect)
        np.testing.assert_array_equal(predict_traction(seen, one, 60.0, SLIPS).pull, plain.pull)
    digging = predict_traction(with_effect(case, SlipSinkage(n1=0.4)), one, 60.0, SLIPS)
    assert (np.abs(digging.pull - plain.pull) > 0.1).all()


def test_extrapolation_is_reported(case):
    one = soils((900.0, 0.6, 0.012))
    measured = MeasuredRange((0.3, 0.35), (50.0, 60.0))
    (far,) = predictions_by_load(case, one, one, [120.0], SLIPS, measured)
    text = " ".join(texts(far.warnings))
    for said in (
        "no slip above 0.35",
        "no slip below 0.3",
        "no load above 60 N",
        "predicted is 120 N",
    ):
        assert said in text
    (near,) = predictions_by_load(case, one, one, [55.0], np.asarray([0.3, 0.4]), measured)
    assert not any("was measured" in said for said in texts(near.warnings))


def test_soils_that_do_not_carry_the_load_are_left_out_and_counted(case):
    draws = SoilDraws(("kphi",), np.asarray([[1.5e6], [1.5e6], [1e4]]))
    (one,) = predictions_by_load(case, draws, draws, [60.0], SLIPS, EVERYWHERE)
    assert one.posterior.failed_fraction == pytest.approx(1 / 3)
    assert remarked(one.warnings, "do not carry 60 N")
    assert np.isfinite(quantile_band(one.posterior.pull).lower).all()
    assert np.isnan(one.posterior.steepest_slope[2]) and np.isnan(one.posterior.best_slip[2])
