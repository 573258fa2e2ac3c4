"""Few rows at one load: what is smooth in slip is no noise, and an excluded soil no cause."""

from dataclasses import replace

import numpy as np
import pytest
from gap_sets import case_of, driven, fit_problem

from datagen.blind_sets import Plan, draw_blind_set
from soilml.fitting.readings import stack_readings
from soilml.gap import gap
from soilml.gap.evidence.covariance import (
    FIXED_EFFECT_TOLERANCES,
    VarianceComponents,
    assemble_covariance,
    estimate_covariance,
    fixed_effects,
    run_effect_columns,
)
from soilml.gap.evidence.directions import smooth_basis, smooth_basis_of_few
from soilml.gap.evidence.outliers import outliers
from soilml.gap.evidence.problem import within_bounds
from soilml.gap.search.stepwise import residual_test
from soilml.io.table import Table
from soilml.numerics.subspaces import column_space


def one_run(slips):
    case = case_of()
    return stack_readings(case, driven(case, loads=(80.0,), slips=slips, noise=0.0))


@pytest.mark.parametrize("slips, functions", [(5, 2), (6, 3), (8, 4), (15, 4), (16, 0)])
def test_few_readings_have_a_smooth_function_for_each_two_of_them(slips, functions):
    assert smooth_basis_of_few(one_run(slips)).shape[1] == 3 * functions


def test_smooth_functions_stay_beside_directions_that_are_a_thousand_times_longer():
    space, smooth = np.zeros((4, 1)), np.zeros((4, 1))
    space[0], smooth[1] = 1e6, 1.0
    together = column_space(np.hstack([space, smooth]), **FIXED_EFFECT_TOLERANCES)
    assert together.shape[1] == 1
    np.testing.assert_allclose(np.abs(fixed_effects(space, smooth)), np.eye(4)[:, :2])


@pytest.mark.parametrize("shape, grows", [("smooth", False), ("rough", True)])
def test_six_rows_scale_their_noise_up_by_what_is_rough_alone(shape, grows):
    """A parabola of slip and alternating signs, of the same size in sinkage."""
    readings = one_run(6)
    x = np.linspace(-1.0, 1.0, 6)
    hump = {"smooth": 1.5 * x**2 - 0.7, "rough": np.asarray([1.0, -1.0] * 3)}[shape]
    residual = np.zeros(len(readings))
    residual[readings.channel == 2] = 5.0 * hump / np.sqrt(np.mean(hump**2))
    residual *= readings.std
    columns, space = np.zeros((len(readings), 2)), smooth_basis(readings)

    def scale(smooth):
        found = estimate_covariance(readings, columns, residual, space, smooth)
        return found.components.noise_scale[2]

    assert scale(None) > 2.0
    assert (scale(smooth_basis_of_few(readings)) > 1.5) == grows


def test_a_smooth_misfit_of_few_rows_has_no_outliers_and_a_wrong_digit_is_one():
    readings = one_run(8)
    usual = VarianceComponents.usual(readings, units=0.0)
    known = assemble_covariance(readings, run_effect_columns(case_of(), readings), usual)
    x = np.linspace(-1.0, 1.0, 8)
    smooth, space = smooth_basis_of_few(readings), smooth_basis(readings)
    misfit, digit = np.zeros(len(readings)), np.zeros(len(readings))
    misfit[readings.channel == 2] = 20.0 * x**2
    digit[3] = 30.0
    assert outliers(known, misfit * readings.std, space).any()
    assert not outliers(known, misfit * readings.std, space, smooth=smooth).any()
    found = outliers(known, digit * readings.std, space, smooth=smooth)
    assert found[3]


def test_a_coordinate_that_is_pressed_against_its_bound_explains_nothing():
    """Only while the readings pull it outwards."""
    case = case_of()
    problem = fit_problem(case, driven(case))
    fit = problem.fit_soil([np.full(3, 0.5)])
    x = fit.x.copy()
    x[0] = fit.coordinates[0].lower
    for sign, pressed in ((-1.0, True), (1.0, False)):
        at = replace(fit, x=x, residual=sign * fit.jacobian[:, 0])
        left = within_bounds(at)
        assert (not left[:, 0].any()) == pressed
        np.testing.assert_array_equal(left[:, 1:], fit.jacobian[:, 1:])


def test_a_gap_that_only_a_soil_beyond_its_priors_would_explain_is_a_gap():
    case = case_of()
    problem = fit_problem(case, driven(case))
    fit = problem.fit_soil([np.full(3, 0.5)])
    x = fit.x.copy()
    x[0] = fit.coordinates[0].lower
    moved = replace(fit.problem.readings, measured=fit.prediction - 0.2 * fit.derivatives[:, 0])
    pressed = replace(fit, x=x, problem=replace(fit.problem, readings=moved))
    signatures = problem.signatures_beside(fit)
    free, held = (
        residual_test(problem, pressed, signatures, 0, within_priors=within).p_value
        for within in (False, True)
    )
    assert free > 0.5 and held < 0.001


@pytest.mark.parametrize("sigma, explained", [(0.1, False), (30.0, True)])
def test_a_soil_far_beyond_its_priors_explains_nothing(sigma, explained):
    """One parameter changes the readings like an effect, by so many sigma over its whole prior.

    The effect is one of ten. As in published tests of few slips, that bend a soil of five
    parameters along a line which no soil within its priors follows.
    """
    case = case_of()
    problem = fit_problem(case, driven(case))
    fit = problem.fit_soil([np.full(3, 0.5)])
    signatures = problem.signatures_beside(fit)
    effect = next(s for s in signatures if s.name == "slip-sinkage").column
    effect = effect / np.linalg.norm(problem.covariance.whiten @ effect)
    derivatives = fit.derivatives.copy()
    derivatives[:, 0] = sigma * effect
    rows = replace(fit.problem.readings, measured=fit.prediction + 10.0 * effect)
    line = replace(fit.linearisation, jacobian=derivatives)
    bent = replace(fit, linearisation=line, problem=replace(fit.problem, readings=rows))
    p = residual_test(problem, bent, signatures, 0, within_priors=True).p_value
    assert p > 0.5 if explained else p < 0.001


@pytest.mark.parametrize("tier, cause, size", [("A", "slip-sinkage", 1.0), ("N0", "", 0.0)])
def test_torque_and_sinkage_of_few_rows_show_slip_sinkage_and_else_nothing(tier, cause, size):
    drawn = draw_blind_set(Plan(tier, cause, size, 0.02, 1, "loam", 5, 7400016, 0.0, "few-rows"))
    columns = {n: v for n, v in drawn.columns.items() if n != "drawbar_pull_N"}
    report = gap(case_of(drawn.model), Table(columns), seed=0)
    if cause:
        assert (report.status, report.cause_set[0]) == ("suspected", ("slip-sinkage",))
    else:
        assert report.status == "no-gap"
