"""Evidence of a fit against dense algebra: value, gradient, prediction of what is left out."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from gap_sets import LOADS, MODEL, case_of, driven

from soilml.fitting.coordinates import select_free
from soilml.fitting.damped_descents import descend
from soilml.fitting.least_squares import LeastSquaresProblem
from soilml.fitting.readings import stack_readings
from soilml.inference.conditional import conditional, leave_one_out
from soilml.inference.evidence import linear_model
from soilml.inference.gaussian_terms import gaussian_terms, scatter_columns
from soilml.inference.priors import prior_of_hyperparameters
from soilml.physics.effects import EFFECTS

DECLARED = MODEL + '[discrepancy]\ntorque_Nm = "2 %"\n'


@cache
def model(text=MODEL, autocorrelation=0.0, outlier=False, loads=LOADS):
    """The soil alone near its fit to rows of an effect, off the optimum, and hyperparameters."""
    case = case_of(text)
    table = driven(case, [EFFECTS["slip-sinkage"](n1=0.2)], loads=loads, slips=5, seed=3)
    readings = stack_readings(case, table)
    terms = gaussian_terms(readings, case, scatter_columns(case, readings))
    strays = np.zeros(len(readings), bool)
    strays[[7, 12]] = outlier
    at = replace(terms.first(), autocorrelation=autocorrelation)
    own = LeastSquaresProblem(
        case, tuple(select_free(case, None)), readings, terms.whiten(at, strays)
    )
    fit = descend(own, np.full(3, 0.4))
    return linear_model(terms, own.linearised(np.minimum(fit.x + 0.01, 0.99)), strays), at


def dense(found, at):
    """Covariance of the readings that are kept with soil integrated out, and their residuals."""
    terms, r = found.terms, found.terms.readings
    std, run, order = terms.noise_std(at), r.run[r.row], r.order[r.row]
    same = (run[:, None] == run) & (r.channel[:, None] == r.channel)
    lag = np.abs(np.subtract.outer(order, order)).astype(float)
    noise = np.where(same, at.autocorrelation**lag, 0.0) if at.autocorrelation else np.eye(len(r))
    matrix = np.outer(std, std) * noise
    matrix = matrix + (terms.columns * terms.variance(at)) @ terms.columns.T
    matrix = matrix + found.jacobian @ np.diag(1.0 / found.precision) @ found.jacobian.T
    kept = ~found.outliers
    return matrix[np.ix_(kept, kept)], found.residual[kept]


MANY = tuple(float(load) for load in np.linspace(30.0, 120.0, 25))
CASES = [
    (MODEL, 0.0, False),
    (DECLARED, 0.0, False),
    (MODEL, 0.5, False),
    (MODEL, 0.0, True),
    (MODEL, 0.0, False, (60.0,)),
    (MODEL, 0.0, True, MANY),
    (DECLARED, 0.5, True, MANY),
]


@pytest.mark.parametrize("present", [True, False])
@pytest.mark.parametrize("case", CASES)
def test_the_value_is_that_of_the_normal_density_of_the_readings(case, present):
    found, at = model(*case)
    at = replace(at, present=present)
    matrix, residual = dense(found, at)
    expected = residual @ np.linalg.solve(matrix, residual) + np.linalg.slogdet(matrix)[1]
    expected += prior_of_hyperparameters(found.terms, at)[0]
    expected += np.log(found.precision).sum() - 3.0 * np.log(2.0 * np.pi)  # of the soil's prior
    assert found.evaluate(at).value == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("present", [True, False])
@pytest.mark.parametrize("case", CASES)
def test_the_gradient_is_that_of_differences(case, present):
    found, at = model(*case)
    at = replace(at, present=present, log=at.log + 0.1 * np.arange(len(at.log)))
    gradient = found.evaluate(at).gradient
    step = 1e-4
    for i in range(len(at.log)):
        ends = [at.log + sign * step * (np.arange(len(at.log)) == i) for sign in (-1, 1)]
        low, high = (found.evaluate(replace(at, log=log)).value for log in ends)
        assert gradient[i] == pytest.approx((high - low) / (2.0 * step), rel=1e-5, abs=1e-4)


@pytest.mark.parametrize("case", CASES)
def test_the_curvature_is_the_expected_information_on_the_terms(case):
    found, at = model(*case)
    terms, kept = found.terms, ~found.outliers
    matrix, _ = dense(found, at)
    columns = (terms.columns * np.sqrt(terms.variance(at)))[kept]
    information = columns.T @ np.linalg.solve(matrix, columns)
    expected = prior_of_hyperparameters(terms, at)[2]
    for g in range(terms.groups):
        own = terms.group == g
        expected[g] += 2.0 * np.sum(information[np.ix_(own, own)] ** 2)
    curvature = found.evaluate(at).curvature
    np.testing.assert_allclose(curvature[: terms.groups], expected[: terms.groups], rtol=1e-6)


@pytest.mark.parametrize("present", [True, False])
@pytest.mark.parametrize("case", CASES)
def test_whitening_makes_the_covariance_of_the_readings_one(case, present):
    found, at = model(*case)
    at, kept = replace(at, present=present), ~found.outliers
    white = found.terms.whiten(at, found.outliers) @ np.eye(len(kept))
    no_soil = replace(found, jacobian=0.0 * found.jacobian)
    matrix, _ = dense(no_soil, at)
    product = (white.T @ white)[np.ix_(kept, kept)] @ matrix
    np.testing.assert_allclose(product, np.eye(len(matrix)), atol=1e-7)
    assert not white[:, ~kept].any()


@pytest.mark.parametrize("case", CASES[:4])
def test_the_gradient_vanishes_at_the_optimum(case):
    """At the optimum of every hyperparameter that is not at a bound it vanishes."""
    found, at = model(*case)
    best = found.best(at, iterations=200).at
    bounds = np.asarray(found.terms.bounds())
    step = 1e-4
    for i, log in enumerate(best.log):
        if bounds[i, 0] + 0.01 < log < bounds[i, 1] - 0.01:
            ends = [best.log + sign * step * (np.arange(len(best.log)) == i) for sign in (-1, 1)]
            low, high = (found.evaluate(replace(best, log=log)).value for log in ends)
            assert abs(high - low) / (2.0 * step) < 1.0
            assert min(low, high) > found.evaluate(best).value - 1e-3


@pytest.mark.parametrize("case", [case for case in CASES if not case[2]])
def test_each_reading_is_predicted_from_all_others(case):
    found, at = model(*case)
    matrix, residual = dense(found, at)
    inverse = np.linalg.inv(matrix)
    error, variance = leave_one_out(found, at)
    np.testing.assert_allclose(variance, 1.0 / np.diag(inverse), rtol=1e-6)
    np.testing.assert_allclose(error, inverse @ residual / np.diag(inverse), rtol=1e-5, atol=1e-9)


def test_readings_left_out_have_their_conditional_density():
    found, at = model()
    out = found.terms.readings.run[found.terms.readings.row] == 1
    matrix, residual = dense(found, at)
    gain = np.linalg.solve(matrix[np.ix_(~out, ~out)], matrix[np.ix_(~out, out)]).T
    given = conditional(found.without(out), at)
    np.testing.assert_allclose(given.expected[out], gain @ residual[~out], rtol=1e-5, atol=1e-8)
    left = matrix[np.ix_(out, out)] - gain @ matrix[np.ix_(~out, out)]
    np.testing.assert_allclose(given.variance[out], np.diag(left), rtol=1e-6)


def test_a_long_step_counts_only_once_it_was_fitted():
    found, at = model()
    far = replace(
        found, residual=found.residual + 40.0 * found.jacobian[:, 1], _products={}, _taken={}
    )
    own = far.evidence(far.evaluate(at))
    assert own.promised > 100.0
    assert own.trusted == pytest.approx(own.value + own.promised - 4.0)
