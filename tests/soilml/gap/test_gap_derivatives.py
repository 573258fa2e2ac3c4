"""Derivatives of the readings at fixed sinkage, trials near an equilibrium, fits in step."""

from dataclasses import replace

import numpy as np
import pytest
from gap_sets import case_of, driven, fit_problem

from soilml.errors import InputError
from soilml.fitting.candidate_effects import with_effect
from soilml.fitting.coordinates import shape_coordinates, size_coordinate
from soilml.fitting.damped_descents import descend_together
from soilml.fitting.joined_cases import CaseSets, joined_load_case
from soilml.fitting.least_squares import LeastSquaresProblem
from soilml.fitting.predictions import (
    PredictionRequest,
    linearise,
    linearise_many,
    predict,
    predict_many,
)
from soilml.gap.evidence.problem import StartedFit, fit_many
from soilml.physics.effects import EFFECTS
from soilml.physics.gears.rigid_wheel import RigidWheel
from soilml.physics.sinkage_estimate import SinkageEstimate

pytestmark = pytest.mark.slow

WHEEL_EFFECTS = [
    name
    for name, effect in EFFECTS.items()
    if not effect.gear_types or RigidWheel in effect.gear_types
]
COVARIATES = {
    "speed": (0.05, 0.1, 0.15, 0.2),
    "pass_number": (1, 2, 3, 4),
    "slip_angle": (0.1, 0.2, 0.05, 0.15),
}
#: Step of the central differences. Their truncation error is of the order of the square of the
#: step, and the tolerance of the search for equilibrium, 1e-9, adds up to 2e-5.
STEP = 1e-4


@pytest.fixture(scope="module")
def problem():
    """A problem with all covariates."""
    case = case_of()
    return fit_problem(case, driven(case, **COVARIATES))


def braked(readings):
    """The readings with every row braking."""
    slip = -0.8 * np.asarray(readings.at.slip)
    return replace(readings, at=replace(readings.at, slip=slip))


def with_coordinates(problem, name):
    """The case with an effect, the coordinates of soil, size and shape, and a point."""
    size = size_coordinate(EFFECTS[name], None)
    shapes = shape_coordinates(EFFECTS[name])
    x = [0.4, 0.5, 0.4, 0.3 if size.upper > 0 else -0.3, *(0.2 for _ in shapes)]
    return (
        with_effect(problem.case, EFFECTS[name]),
        [*problem.soil, size, *shapes],
        np.asarray(x),
    )


@pytest.mark.parametrize("braking", [False, True])
@pytest.mark.parametrize("name", WHEEL_EFFECTS)
def test_derivatives_agree_with_central_differences(problem, name, braking):
    readings = braked(problem.readings) if braking else problem.readings
    case, coordinates, x = with_coordinates(problem, name)
    found = linearise(case, coordinates, x, readings)
    y, jacobian = found.prediction, found.jacobian
    np.testing.assert_allclose(y, predict(case, coordinates, x[None, :], readings)[0], rtol=1e-7)
    for i in range(len(coordinates)):
        sides = np.tile(x, (2, 1))
        sides[:, i] += (STEP, -STEP)
        high, low = predict(case, coordinates, sides, readings)
        central = (high - low) / (2.0 * STEP)
        largest = np.abs(central).max()
        np.testing.assert_allclose(jacobian[:, i], central, rtol=1e-3, atol=2e-5 * largest)
        assert np.abs(jacobian[:, i] - central).max() <= 2e-4 * largest


def test_derivatives_point_inwards_at_an_upper_bound(problem):
    top = replace(problem.soil[0], upper=0.4)
    coordinates = [top, *problem.soil[1:]]
    x = np.asarray([0.4, 0.5, 0.4])
    jacobian = linearise(problem.case, coordinates, x, problem.readings).jacobian
    inside = linearise(problem.case, problem.soil, x, problem.readings).jacobian
    np.testing.assert_allclose(jacobian, inside, rtol=1e-3, atol=1e-6)
    assert np.any(jacobian[:, 0] != inside[:, 0])


def test_rows_without_equilibrium_have_no_derivatives(problem):
    load = np.where(np.arange(32) == 5, 1e6, np.asarray(problem.readings.at.load))
    readings = replace(problem.readings, at=replace(problem.readings.at, load=load))
    found = linearise(problem.case, problem.soil, np.full(3, 0.5), readings)
    y, jacobian = found.prediction, found.jacobian
    unsolved = readings.row == 5
    assert np.isnan(y[unsolved]).all() and np.isnan(jacobian[unsolved]).all()
    assert np.isfinite(y[~unsolved]).all() and np.isfinite(jacobian[~unsolved]).all()


@pytest.mark.parametrize("braking", [False, True])
def test_sinkage_is_predicted_to_first_order(problem, braking):
    readings = braked(problem.readings) if braking else problem.readings
    case, coordinates, x = with_coordinates(problem, "slip-sinkage")
    change = 1e-3 * np.asarray([[1.0, -1.0, 1.0, 1.0, 0.5, -0.5, 0.5]])
    requests = [
        PredictionRequest(case, coordinates, at, readings) for at in (x[None, :], x + change)
    ]
    here, there = linearise_many(requests)
    moved = np.abs(there.log_sinkage - here.log_sinkage).max()
    error = here.sinkage_at(change).log_sinkage[0] - there.log_sinkage
    assert np.abs(error).max() < 1e-2 * moved


@pytest.mark.parametrize("nearest, rough", [(False, False), (True, False), (True, True)])
@pytest.mark.parametrize("distance", [0.0, 1e-3, 0.1, 3.0, np.nan])
@pytest.mark.parametrize("name", ["slip-sinkage", "load-transfer", "stress-shift"])
def test_trials_near_an_equilibrium_reach_it(problem, name, distance, nearest, rough):
    case, coordinates, x = with_coordinates(problem, name)
    request = PredictionRequest(case, coordinates, x[None, :], problem.readings)
    (at,), (searched,) = linearise_many([request]), predict_many([request])
    at = at.log_sinkage[None, :] + distance, at.slope[None, :]
    estimate = SinkageEstimate(*at, nearest=nearest, rough=rough)
    (near,) = predict_many([replace(request, estimate=estimate)])
    rtol = 1e-4 if nearest and not rough else 1e-6
    atol = 0.1 * rtol * np.ptp(searched)
    if nearest and not distance <= 0.1:  # a trial that is too far off is left without readings
        solved = np.isfinite(near)
        assert not solved.all()
        near, searched = near[solved], searched[solved]
    np.testing.assert_allclose(near, searched, rtol=rtol, atol=atol)


def test_cases_evaluated_together_predict_what_they_predict_alone(problem):
    requests = []
    for name in WHEEL_EFFECTS:
        case, coordinates, x = with_coordinates(problem, name)
        sets = np.stack([x, 0.9 * x])
        requests.append(PredictionRequest(case, coordinates, sets, problem.readings))
    for request, found in zip(requests, predict_many(requests), strict=True):
        (alone,) = predict_many([request])
        np.testing.assert_allclose(found, alone, rtol=1e-8)


def test_effects_keep_the_order_of_each_case_when_joined(problem):
    one = problem.with_effects(["slope", "load-transfer"])
    other = problem.with_effects(["load-transfer", "torque-gain"])
    at = problem.readings.at
    joined = joined_load_case([CaseSets(case, 1, {}, at) for case in (one, other)])
    names = [effect.name for effect in joined.effects]
    assert sorted(names) == ["load-transfer", "slope", "torque-gain"]
    assert names.index("slope") < names.index("load-transfer") < names.index("torque-gain")


@pytest.mark.parametrize("value, shown", [(1.6, "1.6 rad"), (np.nan, "nan rad")])
def test_of_joined_cases_a_value_outside_its_bounds_is_named(problem, value, shown):
    at, soil = problem.readings.at, problem.case.soil
    other = np.asarray([soil.cohesion, 2.0 * soil.cohesion])
    values = {"cohesion": other, "friction_angle": np.asarray([0.5, value])}
    parts = [CaseSets(problem.case, 1, {}, at), CaseSets(problem.case, 2, values, at)]
    with pytest.raises(InputError, match=f"soil friction_angle is {shown}"):
        joined_load_case(parts)


def test_cases_with_effects_in_contrary_order_are_answered_one_by_one(problem):
    x = np.full((1, 3), 0.5)
    cases = [problem.with_effects(n) for n in (["slope", "load-gain"], ["load-gain", "slope"])]
    requests = [PredictionRequest(case, problem.soil, x, problem.readings) for case in cases]
    for found in predict_many(requests):
        assert np.isfinite(found).all()


def test_a_refused_request_does_not_spoil_the_others(problem):
    coordinate = size_coordinate(EFFECTS["grousers"], None)
    case = with_effect(problem.case, EFFECTS["grousers"])
    good, bad = (
        PredictionRequest(case, [coordinate], np.asarray([[size]]), problem.readings)
        for size in (0.5, -0.5)
    )
    found, error = predict_many([good, bad])
    assert np.isfinite(found).all()
    assert isinstance(error, InputError) and "grousers.height" in str(error)


def test_fits_in_step_are_those_of_single_fits():
    case = case_of()
    problem = fit_problem(case, driven(case, [EFFECTS["slip-sinkage"](n1=0.3)]))
    names = ["slip-sinkage", "bulldozing", "torque-gain", "stress-shift", "slope"]
    fits = [
        StartedFit(problem.with_effects([n]), [*problem.soil, *problem.size_coordinates([n])], {})
        for n in names
    ]
    whiten = 0.5 * problem.covariance.whiten
    fits.append(replace(fits[0], whiten=whiten))
    for fit, together in zip(fits, fit_many(problem, fits), strict=True):
        (alone,) = fit_many(problem, [fit])
        assert together.converged == alone.converged
        assert together.objective == pytest.approx(alone.objective, rel=1e-4, abs=1e-3)
        np.testing.assert_allclose(together.x, alone.x, atol=1e-3)


def test_an_error_takes_the_place_of_its_fit_alone(problem):
    grousers = replace(size_coordinate(EFFECTS["grousers"], None), lower=-1.0)
    case = with_effect(problem.case, EFFECTS["grousers"])
    readings, whiten = problem.readings, problem.covariance.whiten
    start = np.full(3, 0.5)
    fit, error = descend_together(
        [
            LeastSquaresProblem(problem.case, problem.soil, readings, whiten),
            LeastSquaresProblem(case, [*problem.soil, grousers], readings, whiten),
        ],
        [start, np.append(start, -0.5)],
    )
    assert fit.converged and isinstance(error, InputError)
