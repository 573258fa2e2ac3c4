"""What a wheel pulls and climbs on soils that are known, and how sure one can be."""

import numpy as np
import pytest
from remarked import remarked

from soilml import DrawbarOffset, LoadTransfer, Operating, SlipSinkage
from soilml.config.case import Case
from soilml.remarks import texts
from soilml.traction import DrivenVehicle, SoilDraws, performance, quantile_band
from soilml.traction.prediction import MeasuredRange, predicted

SLIPS = np.asarray([0.1, 0.3, 0.6])
EVERYWHERE = MeasuredRange((0.0, 0.99), (1.0, 1e4))
NAMES = ("cohesion", "friction_angle", "shear_modulus")


def soils(*rows):
    return SoilDraws(NAMES, np.asarray(rows, dtype=float))


def with_effect(case, effect):
    return Case(case.model + effect, case.soil, case.prior, case.noise)


def pulled(case, draws, load, slopes=()):
    return performance(DrivenVehicle.of_wheel(case, load), draws, np.asarray(slopes), SLIPS)


def test_on_the_steepest_slope_the_largest_pull_equals_the_component_of_the_load(case):
    rng = np.random.default_rng(3)
    draws = soils(*zip(*[p.at(rng.random(50)) for p in case.prior.values()], strict=True))
    found = pulled(case, draws, 80.0)
    soil = draws.of(case, np.arange(50)[:, None])
    at = Operating(slip=SLIPS, load=80.0 * np.cos(found.steepest_slope)[:, None])
    pull = np.nan_to_num(np.asarray(soil.model(soil.soil, at).drawbar_pull), nan=-np.inf)
    weight = 80.0 * np.sin(found.steepest_slope)
    np.testing.assert_allclose(pull.max(axis=1), weight, atol=1e-6)


def test_a_wheel_that_only_goes_downhill_has_no_steepest_slope(case):
    found = pulled(case, soils((0.0, 0.05, 0.02)), 80.0)
    assert found.largest_pull[0] < 0.0 and np.isnan(found.steepest_slope[0])


def test_effects_of_the_soil_count_and_those_of_rig_and_sensors_do_not(case):
    one = soils((900.0, 0.6, 0.012))
    plain = pulled(case, one, 60.0)
    for effect in (DrawbarOffset(offset=3.0), LoadTransfer(offset=20.0)):
        seen = with_effect(case, effect)
        np.testing.assert_array_equal(pulled(seen, one, 60.0).pull, plain.pull)
    digging = pulled(with_effect(case, SlipSinkage(n1=0.4)), one, 60.0)
    assert (np.abs(digging.pull - plain.pull) > 0.1).all()


def known(case, draws, load, slip, measured):
    """A prediction whose prior is its posterior."""
    return predicted(DrivenVehicle.of_wheel(case, load), draws, draws, np.zeros(0), slip, measured)


def test_extrapolation_is_reported(case):
    one = soils((900.0, 0.6, 0.012))
    measured = MeasuredRange((0.3, 0.35), (50.0, 60.0))
    far = known(case, one, 120.0, SLIPS, measured)
    text = " ".join(texts(far.warnings))
    for said in (
        "no slip above 0.35",
        "no slip below 0.3",
        "no load above 60 N",
        "predicted is 120 N",
    ):
        assert said in text
    near = known(case, one, 55.0, np.asarray([0.3, 0.4]), measured)
    assert not any("was measured" in said for said in texts(near.warnings))


def test_soils_that_do_not_carry_the_load_are_left_out_and_counted(case):
    draws = SoilDraws(("kphi",), np.asarray([[1.5e6], [1.5e6], [1e4]]))
    one = known(case, draws, 60.0, SLIPS, EVERYWHERE)
    assert one.posterior.failed_fraction == pytest.approx(1 / 3)
    assert remarked(one.warnings, "do not carry 60 N")
    assert np.isfinite(quantile_band(one.posterior.pull).lower).all()
    assert np.isnan(one.posterior.steepest_slope[2]) and np.isnan(one.posterior.strongest_slip[2])
