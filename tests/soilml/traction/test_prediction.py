"""What a wheel pulls and climbs on soils that are known, and how sure one can be."""

import numpy as np
import pytest
from remarked import remarked

from soilml import DrawbarOffset, LoadTransfer, Operating, SlipSinkage, read_case
from soilml.config.case import Case
from soilml.errors import InputError
from soilml.remarks import texts
from soilml.traction import SoilDraws, predict_traction, prior_draws, quantile_band
from soilml.traction.by_load import MeasuredRange, predictions_by_load, slip_grid

SLIPS = np.asarray([0.1, 0.3, 0.6])
EVERYWHERE = MeasuredRange((0.0, 0.99), (1.0, 1e4))
NAMES = ("cohesion", "friction_angle", "shear_modulus")


@pytest.fixture
def case(model_file):
    return read_case(model_file)


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


def test_on_sand_without_cohesion_no_slope_is_steeper_than_its_friction_angle(case):
    found = predict_traction(case, soils((0.0, 0.5, 0.01), (0.0, 0.7, 0.01)), 20.0, SLIPS)
    assert (found.steepest_slope < [0.5, 0.7]).all()
    assert found.steepest_slope[1] > found.steepest_slope[0]


def test_a_heavier_wheel_pulls_more_and_climbs_less(case):
    light, heavy = (
        predict_traction(case, soils((900.0, 0.6, 0.012)), w, SLIPS) for w in (40.0, 120.0)
    )
    assert heavy.largest_pull > light.largest_pull
    assert heavy.steepest_slope < light.steepest_slope


def test_a_light_wheel_on_sticky_soil_climbs_walls_with_a_warning(case):
    sticky = soils((2e4, 0.7, 0.002))
    (one,) = predictions_by_load(case, sticky, sticky, [5.0], SLIPS, EVERYWHERE)
    assert one.posterior.steepest_slope[0] == pytest.approx(1.5)
    assert remarked(one.warnings, "vehicles overturn")


def test_a_known_soil_has_no_band_and_the_model_s_own_pull(case):
    one = (900.0, 0.6, 0.012)
    found = quantile_band(predict_traction(case, soils(one, one, one), 60.0, SLIPS).pull)
    true = case.with_values(dict(zip(NAMES, one, strict=True)))
    pull = true.model(true.soil, Operating(slip=SLIPS, load=60.0)).drawbar_pull
    for part in (found.lower, found.middle, found.upper):
        np.testing.assert_allclose(part, pull, rtol=1e-9)


def test_effects_of_the_soil_count_and_those_of_rig_and_sensors_do_not(case):
    one = soils((900.0, 0.6, 0.012))
    plain = predict_traction(case, one, 60.0, SLIPS)
    for effect in (DrawbarOffset(offset=3.0), LoadTransfer(offset=20.0)):
        seen = with_effect(case, effect)
        np.testing.assert_array_equal(predict_traction(seen, one, 60.0, SLIPS).pull, plain.pull)
    digging = predict_traction(with_effect(case, SlipSinkage(n1=0.4)), one, 60.0, SLIPS)
    assert (np.abs(digging.pull - plain.pull) > 0.1).all()


def test_the_best_slip_is_inside_where_digging_costs_more_than_slip_brings(case):
    digging = with_effect(case, SlipSinkage(n1=1.5))
    slips = np.linspace(0.05, 0.9, 18)
    found = predict_traction(digging, soils((900.0, 0.6, 0.012)), 60.0, slips)
    i = int(np.argmax(found.pull[0]))
    assert 0 < i < 17 and found.best_slip[0] == slips[i] and found.rising_fraction == 0.0
    assert found.largest_pull[0] == found.pull[0, i]


def test_draws_of_the_prior_are_reported_as_not_identified(case):
    before = prior_draws([free_of(case, name) for name in NAMES], 60)
    (one,) = predictions_by_load(case, before, before, [60.0], SLIPS, EVERYWHERE)
    assert one.remaining_fraction == (1.0, 1.0)
    assert [remark.code for remark in one.warnings].count("not-identified") == 2
    (sure,) = predictions_by_load(
        case, soils((900.0, 0.6, 0.012)), before, [60.0], SLIPS, EVERYWHERE
    )
    assert sure.remaining_fraction == (0.0, 0.0)
    assert not remarked(sure.warnings, "identified")


def free_of(case, name):
    from soilml.fitting.coordinates import select_free

    return select_free(case, [name])[0]


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


def test_a_load_that_the_soil_does_not_carry_is_refused_with_what_it_carries(case):
    one = soils((900.0, 0.6, 0.012))
    with pytest.raises(InputError, match="at most about") as refused:
        predictions_by_load(case, one, one, [1e6], SLIPS, EVERYWHERE)
    limit = float(str(refused.value).split("at most about ")[1].split(" N")[0])
    predictions_by_load(case, one, one, [0.9 * limit], SLIPS[:1], EVERYWHERE)


def test_soils_that_do_not_carry_the_load_are_left_out_and_counted(case):
    draws = SoilDraws(("kphi",), np.asarray([[1.5e6], [1.5e6], [1e4]]))
    (one,) = predictions_by_load(case, draws, draws, [60.0], SLIPS, EVERYWHERE)
    assert one.posterior.failed_fraction == pytest.approx(1 / 3)
    assert remarked(one.warnings, "do not carry 60 N")
    assert np.isfinite(quantile_band(one.posterior.pull).lower).all()
    assert np.isnan(one.posterior.steepest_slope[2]) and np.isnan(one.posterior.best_slip[2])


def test_slips_end_at_the_limit():
    assert slip_grid(0.3, EVERYWHERE)[-1] == 0.3
    assert slip_grid(None, MeasuredRange((0.1, 0.2), (1.0, 2.0)))[-1] == 0.6
    for limit in (0.0, 1.0, -0.2, float("nan")):
        with pytest.raises(InputError, match="between 0 and 1"):
            slip_grid(limit, EVERYWHERE)
