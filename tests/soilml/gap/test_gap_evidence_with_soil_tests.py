"""Evidence, spreads and words of an analysis where a wrong sign would hide: by hand."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from gap_sets import case_of, driven, fit_problem, remark
from remarked import remarked

from soilml import Table
from soilml.errors import InputError
from soilml.gap.design.planned_readings import planned_readings
from soilml.gap.evidence.linearised_fit import (
    AMPLITUDES,
    NO_DISCREPANCY,
    UNKNOWN_CAUSE,
    UNKNOWN_SCALE,
    amplitude_penalty,
)
from soilml.gap.evidence.marginal_likelihood import TEMPERING, outside_bounds
from soilml.gap.report.results import GapReport
from soilml.gap.report.sentences import unsupported_conclusions
from soilml.gap.verdict.estimates import SIZES, _size_posterior
from soilml.numerics.prior import UNIFORM_PRECISION
from soilml.physics.effects import EFFECTS
from soilml.physics.soils.soil_tests import ShearStrength
from soilml.remarks import texts


@pytest.fixture(scope="module")
def tested():
    """Rows of a wheel that digs itself in, and a shear test of a firmer soil."""
    case = case_of()
    firm = ShearStrength(normal_stress=8e3, strength=7e3, scatter=0.1)
    table = driven(case, [EFFECTS["slip-sinkage"](n1=0.4)], seed=2)
    problem = fit_problem(replace(case, soil_tests=(firm,)), table, (0.8, 0.8))
    return problem, problem.fit_soil([np.full(3, 0.5)])


def test_a_test_of_the_soil_is_a_residual_of_the_evidence(tested):
    """Dense algebra, with the deviation d and its rates R: d'd, R'R beside X'X, X'r - R'd."""
    problem, soil = tested
    found = problem.discrepancy.evidence(soil)
    d, rates = soil.soil_tests.deviation(soil.x), soil.soil_tests.rates(soil.x)
    assert abs(d[0]) > 0.4
    matrix = problem.discrepancy.matrix(found.amplitude)
    inverse = np.linalg.inv(matrix)
    residual = soil.measured - soil.prediction
    h = soil.derivatives.T @ inverse @ soil.derivatives + rates.T @ rates
    h += UNIFORM_PRECISION * np.eye(3)
    slope = soil.derivatives.T @ inverse @ residual - rates.T @ d
    inside = (soil.x > 0.0) & (soil.x < 1.0)
    gradient = slope[inside]
    step = np.linalg.solve(h[np.ix_(inside, inside)], gradient)
    value = residual @ inverse @ residual + d @ d - gradient @ step
    value += outside_bounds(soil, slope, h) + np.linalg.slogdet(h)[1]
    value += np.linalg.slogdet(matrix)[1] - np.linalg.slogdet(problem.covariance.matrix)[1]
    value += amplitude_penalty(found.amplitude[None, :])[0]
    assert found.value == pytest.approx(value, rel=1e-6)


def test_prior_probabilities_of_amplitudes():
    """Between geometric means of neighbours: of an exponential, and of a half-Cauchy."""
    edges = [0.0, *(np.sqrt(a * b) for a, b in pairwise(AMPLITUDES[1:]))]

    def below(x):
        heavy = 2.0 * np.arctan(x / UNKNOWN_SCALE) / np.pi
        return (1.0 - UNKNOWN_CAUSE) * (1.0 - np.exp(-x)) + UNKNOWN_CAUSE * heavy

    inside = np.diff([*(below(x) for x in edges), 1.0])
    expected = [NO_DISCREPANCY, *((1.0 - NO_DISCREPANCY) * inside)]
    found = np.exp(-0.5 * amplitude_penalty(AMPLITUDES[:, None]))
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_odds_of_an_effect_are_those_of_its_likelihood_tempered():
    """A column of norm 2 at right angles to the residual, whose size has a prior of std 0.3."""
    size, log = _size_posterior(np.asarray([2.0, 0.0]), np.asarray([0.0, 1.0]), 1, 0.3)
    np.testing.assert_array_equal(size, SIZES)
    prior = SIZES * np.exp(-0.5 * (SIZES / 0.3) ** 2)  # by the logarithm of the size
    likelihood = np.exp(-0.5 * 4.0 * SIZES**2)
    evidence = np.sum(prior * likelihood) / np.sum(prior)
    assert np.exp(log).sum() == pytest.approx(evidence**TEMPERING)
    shares = prior * likelihood / np.sum(prior * likelihood)
    np.testing.assert_allclose(np.exp(log) / np.exp(log).sum(), shares, rtol=1e-9)


def test_a_size_of_either_sign_has_both():
    size, log = _size_posterior(np.asarray([1.0]), np.asarray([0.5]), 0, np.inf)
    assert size.tolist() == [*-SIZES, *SIZES]
    k = int(np.argmin(np.abs(SIZES - 1.0)))
    # readings that show half a size are likelier at +s than at -s by exp(s)
    assert log[len(SIZES) + k] - log[k] == pytest.approx(SIZES[k])


def test_a_load_that_cannot_be_carried_is_named_by_its_row():
    case = case_of()
    design = Table(
        {
            "run": np.asarray(["a", "a", "a"]),
            "slip": np.asarray([0.1, 0.2, 0.3]),
            "load_N": np.asarray([60.0, 1e6, 1e6]),
        }
    )
    with pytest.raises(InputError, match="row 2"):
        planned_readings(case, design)
    one = Table({name: column[:2] for name, column in design.columns.items()})
    with pytest.raises(InputError, match="row 2"):
        planned_readings(case, one)


@pytest.mark.parametrize(
    ("status", "said"),
    [
        ("no-gap", "that the model is complete"),
        ("undecided", "that the model is complete"),
        ("named", "that no cause outside the catalogue has the same signature"),
        ("form-open", "the law of the effect"),
        ("partly-named", "the cause of the remaining discrepancy"),
        ("class", "which of the effects is present"),
        ("unknown", "any cause: model.toml contains the refitted soil and no new effect"),
        ("suspected", "any cause: an effect that model.toml marks as suspected predicts"),
        ("not-testable", "that a smaller gap proves a cause"),
    ],
)
def test_conclusions_that_a_status_does_not_support(status, said):
    everything = {
        "that the model is complete": {"no-gap", "undecided"},
        "no cause outside the catalogue": {"named", "form-open", "partly-named"},
        "the law of the effect": {"form-open"},
        "the cause of the remaining": {"partly-named"},
        "which of the effects": {"class"},
        "any cause: model.toml contains": {"unknown"},
        "marks as suspected": {"suspected"},
        "that kphi in the model file": {
            *("named", "form-open", "partly-named", "class", "unknown", "suspected"),
            "not-testable",
        },
    }
    report = GapReport(status, "", case_of())
    found = texts(unsupported_conclusions(report, [remark("one load only")], ["kphi"]))
    assert found[0] == "the cause of the gap: one load only"
    assert remarked(found, said)
    for words, statuses in everything.items():
        assert remarked(found, words) == (status in statuses), words
