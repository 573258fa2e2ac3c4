"""Intervals of the soil where an effect may be present without being detected."""

from dataclasses import replace

import numpy as np
import pytest
from gap_sets import case_of, driven, fit_problem

from soilml.fitting.effect_signatures import effect_signatures
from soilml.gap import gap
from soilml.gap.verdict.estimates import SIZES, by_undetected_effects


@pytest.fixture(scope="module")
def problem():
    case = case_of()
    return fit_problem(case, driven(case, seed=4))


@pytest.mark.parametrize("name", ["torque-gain", "bulldozing", "load-gain"])
def test_an_omitted_effect_moves_the_soil_as_a_fit_to_changed_readings_does(problem, name):
    soil = problem.fit_soil([np.full(3, 0.5)])
    (signature,), _ = effect_signatures(
        soil.fitted(), problem.readings, {name: problem.effects[name]}
    )
    spread = by_undetected_effects(problem, soil, [signature])
    small = int(np.argmin(np.abs(spread.offset["friction_angle"][1:]))) + 1
    changed = replace(
        problem.readings,
        measured=problem.readings.measured
        + np.sign(signature.sign or 1) * SIZES[0] * signature.column,
    )
    moved = replace(problem, readings=changed).fit_soil([soil.x])
    for path, value in soil.values().items():
        change = moved.values()[path] - value
        expected = np.abs(spread.offset[path][small])
        assert abs(change) == pytest.approx(expected, rel=0.05, abs=1e-3 * soil.stds()[path])


def test_a_prior_holds_the_soil_where_readings_are_poor(problem):
    soil = problem.fit_soil([np.full(3, 0.5)])
    (signature,), _ = effect_signatures(
        soil.fitted(), problem.readings, {"slip-sinkage": problem.effects["slip-sinkage"]}
    )
    poor = replace(problem.covariance, whiten=0.003 * problem.covariance.whiten)
    spread = by_undetected_effects(replace(problem, covariance=poor), soil, [signature])
    # the prior as three further readings: each coordinate is uniform from 0 to 1, variance 1/12
    known = soil.whitened_by(poor.whiten)
    assert (known.precision == 0.0).all() and (np.linalg.norm(known.jacobian, axis=0) < 3.0).any()
    rows = np.vstack([known.jacobian, np.sqrt(12.0) * np.eye(3)])
    column = np.concatenate([poor.whiten @ signature.column, np.zeros(3)])
    moved = np.linalg.lstsq(rows, column)[0]
    for i, coordinate in enumerate(known.coordinates):
        expected = signature.sign * SIZES * moved[i] * coordinate.rate(float(known.x[i]))
        assert spread.offset[coordinate.path][1:] == pytest.approx(expected)


def test_a_size_that_the_readings_exclude_has_no_weight(problem):
    soil = problem.fit_soil([np.full(3, 0.5)])
    signatures, _ = effect_signatures(
        soil.fitted(), problem.readings, {"slip-sinkage": problem.effects["slip-sinkage"]}
    )
    spread = by_undetected_effects(problem, soil, signatures)
    assert spread.weight[0] == spread.weight.max()  # no effect is the likeliest
    assert spread.weight[-1] < 1e-12  # five times the reference size
    assert spread.weight[1] > 1e-4  # a hundredth of it


def test_without_a_gap_intervals_allow_for_what_the_runs_cannot_show():
    case = case_of()
    report = gap(case, driven(case, seed=4))
    assert report.status == "no-gap"
    for name, before in report.soil_before.items():
        after = report.soil_after[name]
        assert after.value == before.value
        assert 1.02 * before.std < after.std < 10.0 * before.std
