"""Steps of the fits against their formulas: noise, covariance, descent, Newton, samples."""

from dataclasses import replace
from importlib import import_module
from types import SimpleNamespace

import numpy as np
import pytest
from channel_readings import rows_of

from soilml import Operating, read_case
from soilml.errors import FitError
from soilml.fitting import misfit, scipy_descents
from soilml.fitting.coordinates import select_free
from soilml.fitting.least_squares import LeastSquaresProblem, Solution
from soilml.identification import condensing
from soilml.identification.posterior_density import PosteriorDensity
from soilml.identification.posterior_sampling import normal_root
from soilml.numerics.surface_sampling import normal_sample
from soilml.remarks import texts

# the package has functions of these names
linear, newton, nonlinear = (
    import_module(f"soilml.identification.{name}") for name in ("linear", "newton", "nonlinear")
)


@pytest.fixture
def case(model_file):
    return read_case(model_file)


def optimum(x, jacobian, residual=(0.0, 0.0), of_tests=0.0):
    """A solution; tests of the soil add `of_tests` to its cost."""
    x, residual, jacobian = (np.asarray(v, dtype=float) for v in (x, residual, jacobian))
    tests = SimpleNamespace(
        deviation=lambda x: np.sqrt([of_tests]), rates=lambda x: np.zeros((1, len(x)))
    )
    problem = SimpleNamespace(
        soil_tests=tests, coordinates=(), normal_deviation=lambda x: (0.0 * x, 0.0 * x)
    )
    return Solution(problem, x, None, residual, jacobian, 0.0, True)


def test_covariance_of_least_squares_includes_prior_and_distance_to_its_mean():
    at = optimum([0.2, 0.5], [[3.0, 0.0], [0.0, 1.0]])
    precision = np.asarray([12.0, 12.0])
    found, std = nonlinear._covariance(at, at, 4.0, np.diag(precision), precision)
    variance = 1.0 / (np.asarray([9.0, 1.0]) / 4.0 + 12.0)
    np.testing.assert_allclose(std, np.sqrt(variance))
    to_mean = variance * 12.0 * np.asarray([0.3, 0.0])
    np.testing.assert_allclose(np.diag(found), variance + to_mean**2)
    other = optimum([0.9, 0.5], [[0.0, 0.0], [0.0, 1.0]])
    found, _ = nonlinear._covariance(at, other, 4.0, np.diag(precision), precision)
    np.testing.assert_allclose(found[0, 0], 1.0 / 12.0 + 0.7**2)
    assert found[0, 1] == 0.0


def test_noise_before_and_after_a_fit_is_that_of_each_channel(case):
    reading = np.asarray([3.0, 4.0, 3.0, 4.0, 1.0, 1.0, 1.0])
    residual = np.asarray([1.0, -1.0, 1.0, -1.0, 0.1, 0.1, -0.2])
    data = rows_of(case, measured=reading)
    found = misfit._residual_noise(data, residual, 3)
    # three parameters, shared among four and three readings
    torque, sinkage = np.sqrt(4.0 / (4.0 - 12.0 / 7.0)), np.sqrt(0.06 / (3.0 - 9.0 / 7.0))
    np.testing.assert_allclose(found, [torque] * 4 + [sinkage] * 3)
    exact = misfit._residual_noise(data, 0.0 * residual, 3)
    np.testing.assert_allclose(exact, [1e-6 * np.sqrt(12.5)] * 4 + [1e-6] * 3, rtol=1e-6)
    many = misfit._residual_noise(data, residual, 7)
    np.testing.assert_allclose(many[0], 2.0)  # at least one degree of freedom
    first = misfit._initial_noise(data)
    np.testing.assert_allclose(first, [0.05 * np.sqrt(12.5)] * 4 + [0.05] * 3)


def test_a_trial_leads_to_a_known_optimum_where_the_cost_is_its_quadratic():
    known = optimum([0.5, 0.5], np.eye(2), residual=[1.0, 0.0], of_tests=0.2)
    leads = scipy_descents._leads_to

    def trial(distance, excess, prior=0.2, count=2):
        residual = np.zeros(count)
        residual[0] = np.sqrt(1.0 + excess)
        return optimum([0.5 + distance, 0.5], np.eye(2), residual, prior)

    assert leads(known, trial(0.02, 0.0004)) and not leads(known, trial(0.031, 0.0009))
    assert leads(known, trial(0.02, 0.019)) and not leads(known, trial(0.02, 0.022))
    assert not leads(known, trial(0.02, 0.0004, prior=0.25))
    assert not leads(known, trial(0.02, 0.0004, count=1))
    assert known.cost == 1.0


def test_steps_of_newton_are_halved_until_the_cost_falls_inside_the_range():
    def line(u):
        return 10.0 * (u - 0.5), 10.0 * np.eye(3)

    u, residual, _ = newton._minimise(line, np.full(3, 0.2))
    np.testing.assert_allclose(u, 0.5)
    np.testing.assert_allclose(residual, 0.0, atol=1e-9)
    start = np.full(3, 0.2)
    found = newton._line_search(line, start, np.full(3, 1.2), 3 * 9.0001)
    np.testing.assert_allclose(found[0], 0.8)  # 1.4 is outside; 0.8 costs no more
    assert newton._line_search(line, start, np.full(3, 1.2), 3 * 8.99)[0] == pytest.approx(0.5)
    assert newton._line_search(line, start, np.full(3, -0.1), 3 * 9.0) is None
    with pytest.raises(FitError, match="left the range"):
        newton._minimise(lambda u: (np.full(3, np.nan), np.eye(3)), start)
    with pytest.raises(FitError, match="does not converge"):
        newton._minimise(lambda u: (np.exp(-u), np.eye(3)), start)
    newton._check_rank(np.diag([1.0, 1.0, 1.1e-6]))
    for singular in (np.diag([1.0, 1.0, 0.9e-6]), np.ones((2, 3))):
        with pytest.raises(FitError, match="too similar"):
            newton._check_rank(singular)


def test_limits_of_the_linear_method_are_said(case):
    free = select_free(case, ["cohesion", "friction_angle", "shear_modulus", "kphi"])
    several = np.asarray([30.0, 60.0])
    said = texts(linear._limits(case, free, np.asarray([1.0, 0.5]), several))
    assert said == ["kphi is not identified by the linear method"]
    for solution in ([-1.0, 0.5], [1.0, -0.5]):
        said = texts(linear._limits(case, [], np.asarray(solution), several))
        assert said == ["the linear method gives a negative value, which no soil has"]
    said = texts(linear._limits(case, [], np.zeros(2), np.full(2, 60.0)))
    assert said == ["one load only: cohesion is not identified"]
    with pytest.raises(FitError, match="needs drawbar_pull"):
        linear._of_rows(rows_of(case), "drawbar_pull")


def test_the_linear_method_takes_the_larger_of_declared_and_seen_noise(case):
    data, free = rows_of(case), select_free(case, ["cohesion", "friction_angle"])

    def std(factor, scatter=0.0, count=4):
        seen = np.asarray([0.0, 1.0, -1.0, 1.0]) * scatter
        torque = data.channel == 0
        reading = data.measured * (1.0 + np.where(torque, seen[data.row], 0.0))
        given = replace(data, measured=reading, std=factor * data.std)
        given = given.subset(~torque | (data.row < count))
        return np.sqrt(np.diag(linear._solve(case, given, free).covariance))

    fine = std(1.0)
    np.testing.assert_allclose(std(3.0), 3.0 * fine, rtol=0.1)  # residuals are below the noise
    assert np.isfinite(std(1.0, count=3)).all()  # two rows: no residual is left
    rough = std(0.01, scatter=0.1)
    assert (rough > 0.03 * fine).all()  # residuals above the noise
    np.testing.assert_allclose(std(0.02, scatter=0.1), rough, rtol=0.1)


def test_samples_of_the_linearised_posterior_are_somewhat_wider(case):
    data = rows_of(case)
    density = PosteriorDensity(case, data, select_free(case, None), noise_scale=2.0)
    jacobian = np.asarray([[90.0, 0.0, 30.0], [0.0, 80.0, 0.0], [0.0, 0.0, 100.0]])
    at = [0.5, 0.4, 0.6]
    found = normal_sample(np.asarray(at), normal_root(density, optimum(at, jacobian, np.zeros(3))))
    covariance = 1.44 * np.linalg.inv(jacobian.T @ jacobian / 4.0 + 12.0 * np.eye(3))
    np.testing.assert_allclose(found.u.mean(axis=0), [0.5, 0.4, 0.6], atol=2e-3)
    np.testing.assert_allclose(np.cov(found.u.T), covariance, atol=0.1 * covariance.max())
    assert found.weights.sum() == pytest.approx(1.0) and (np.abs(found.u - 0.5) < 0.5).all()
    edge = normal_sample(np.asarray([0.0, 1.0, 0.5]), 0.5 * np.eye(3))
    assert (edge.u > 0.0).all() and (edge.u < 1.0).all()
    assert np.mean(edge.u[:, 0] < 0.1) > 0.1  # reflected, not cut off


def test_rows_of_other_gears_passes_and_directions_are_never_one():
    at = Operating(
        slip=np.asarray([0.1, -0.1, 0.1, 0.1, 0.2, 0.0]),
        load=np.full(6, 60.0),
        pass_number=np.asarray([1.0, 1.0, 2.0, 1.0, 1.0, 1.0]),
        gear=np.asarray(["a", "a", "a", "b", "a", "a"]),
    )
    groups = condensing._groups(at)
    assert groups[0] == groups[4] == groups[5] and len(np.unique(groups)) == 4
    solved = np.asarray([True, True, False, True, True, True])
    number, first = np.asarray([0, 1, 2, 0, 0]), np.asarray([0, 1, 3])
    means = condensing._means(at, solved, number, first)
    np.testing.assert_allclose(means.slip, [0.1, -0.1, 0.1])
    assert means.gear.tolist() == ["a", "a", "b"] and means.pass_number.tolist() == [1.0, 1.0, 1.0]
    joined = condensing._joined(means, replace(at, slip=at.slip + 1.0))
    np.testing.assert_allclose(joined.slip, [0.1, -0.1, 0.1, *(at.slip + 1.0)])
    assert joined.load.shape == joined.gear.shape == (9,) and joined.speed is None
    blocks = [b.tolist() for b in condensing._blocks(50_002)]
    assert len(blocks) == 2 and blocks[1] == [50_000, 50_001] and blocks[0][0] == 0


def test_methods_in_closed_form_say_what_rows_they_need(case):
    data = rows_of(case).of_channels([0])

    def first(count):
        return data.of_rows(np.arange(count))[1]

    with pytest.raises(FitError, match="2 readings: the Newton-Raphson method needs three or more"):
        newton.newton(case, first(2), select_free(case, None))
    try:
        newton.newton(case, first(3), select_free(case, None))
    except FitError as error:  # three readings may not determine three unknowns
        assert "needs three or more" not in str(error)


def test_a_row_without_equilibrium_has_a_residual_of_a_thousand_standard_deviations():
    readings = SimpleNamespace(measured=np.asarray([1.0, 2.0]), std=np.asarray([0.1, 0.5]))
    problem = LeastSquaresProblem(None, (), readings, np.eye(2))
    np.testing.assert_allclose(problem.residual(np.asarray([[1.5, np.nan]])), [[-0.5, 500.0]])
