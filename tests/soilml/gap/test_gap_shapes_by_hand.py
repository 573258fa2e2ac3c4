"""Gains by other laws of an effect, and the choice between fits, evaluated by hand."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from gap_sets import candidate, case_of, driven, fit_problem, with_readings

from soilml.fitting.effect_signatures import Signature
from soilml.gap.evidence.marginal_likelihood import Evidence
from soilml.gap.evidence.problem import MarginalFit
from soilml.gap.search import explanation
from soilml.gap.search.explanation import (
    _better,
    predicted_shape_gain,
    shape_directions,
)
from soilml.gap.search.screening import free_law_gains
from soilml.gap.verdict.reductions import plain_fit
from soilml.physics.effects.slip_sinkage import SlipSinkage


@pytest.fixture(scope="module")
def dug():
    case = case_of()
    problem = fit_problem(case, driven(case, [SlipSinkage(n1=0.3)], seed=2))
    return problem, candidate(problem, ["slip-sinkage"], {})


def test_directions_of_other_laws_are_of_second_order_in_slip_and_load(dug):
    problem, found = dug
    s, w = np.log(problem.readings.slip + 0.03), np.log(problem.readings.load)
    s, w = s - s.mean(), w - w.mean()
    known_s, known_w = problem.readings.log_slip_and_load
    assert s == pytest.approx(known_s - known_s.mean())
    assert w == pytest.approx(known_w - known_w.mean())
    signature = found.fit.derivatives[:, 3]
    directions = shape_directions(problem, found.fit)
    for (direction,), term in zip([d.T for d in directions], (s * s, s * w, w * w), strict=True):
        assert direction == pytest.approx(signature * term)
    certain = candidate(problem, ["torque-gain"], {})  # its law has no shape
    assert shape_directions(problem, certain.fit) == []


def test_the_gain_by_shapes_is_what_columns_beside_the_fit_explain(dug):
    problem, found = dug
    amplitude = found.catalogue_law.evidence.amplitude
    whiten, fit = problem.discrepancy.whiten(amplitude), found.fit
    signature = fit.derivatives[:, 3]
    slip, logs = problem.readings.slip, problem.readings.log_slip_and_load
    columns = whiten @ np.column_stack([signature * t for t in (slip, *logs)])
    residual = fit.residual
    alone = residual - fit.jacobian @ np.linalg.lstsq(fit.jacobian, residual)[0]
    both = np.column_stack([fit.jacobian, columns])
    left = residual - both @ np.linalg.lstsq(both, residual)[0]
    gain = np.sum(alone**2) - np.sum(left**2)
    assert gain > 0.1
    assert predicted_shape_gain(problem, found) == pytest.approx(gain, rel=1e-5)


def test_an_effect_of_a_small_size_in_its_direction_gains_by_its_own_law(dug):
    problem, _ = dug
    soil = problem.fit_soil([np.full(3, 0.5)])
    none = candidate(problem, [], {})
    rng = np.random.default_rng(1)
    column = rng.standard_normal(len(problem.readings)) * problem.readings.std
    exact = with_readings(soil, soil.prediction + 0.2 * column)
    signatures = [
        Signature(name, "soil", sign * column, side)
        for name, sign, side in (("up", 1, 1), ("down", 1, -1), ("any", 1, 0), ("turned", -1, 1))
    ]
    gains = free_law_gains(problem, none.amplitude, exact, signatures)
    assert gains["up"] == gains["any"] > 0.5
    assert gains["down"] == gains["turned"] == 0.0


def test_a_gain_by_an_own_law_is_what_columns_beside_the_fit_explain(dug):
    problem, found = dug
    soil, none = problem.fit_soil([np.full(3, 0.5)]), candidate(problem, [], {})
    whiten = problem.discrepancy.whiten(none.amplitude)
    white = soil.whitened_by(whiten)
    signature = found.fit.derivatives[:, 3]
    terms = (np.ones(len(problem.readings)), *problem.readings.log_slip_and_load)
    columns = whiten @ np.column_stack([signature * term for term in terms])
    beside = columns - white.jacobian @ np.linalg.lstsq(white.jacobian, columns)[0]
    left = white.residual - beside @ np.linalg.lstsq(beside, white.residual)[0]
    gains = free_law_gains(problem, none.amplitude, soil, [Signature("dug", "soil", signature, 0)])
    assert gains["dug"] == pytest.approx(np.sum(white.residual**2) - np.sum(left**2), rel=1e-6)


def test_each_candidate_keeps_the_better_of_its_fits_with_shapes(dug, monkeypatch):
    """The first has two starts, under discrepancy and under noise; the second has one."""
    problem, found = dug
    first = replace(found, noise_only=replace(found.fit))
    none = np.zeros(1)
    fits = [MarginalFit(SimpleNamespace(), Evidence(v, none, none, none)) for v in (2.0, 3.0, 1.0)]
    asked = []

    def fitted(problem, started, lowest):
        asked.extend(amplitude for _, amplitude in started)
        return fits

    monkeypatch.setattr(explanation, "fit_marginal", fitted)
    one, two = explanation.fit_shapes(problem, [first, found])
    assert one.free_law is fits[0] and two.free_law is fits[2]
    np.testing.assert_array_equal(asked[0], found.amplitude)
    np.testing.assert_array_equal(asked[1], np.zeros(len(problem.readings.channels)))
    asked.clear()
    fits.pop()
    explanation.fit_shapes(problem, [first, found], limit=found.fit.objective)
    assert len(asked) == 2
    asked.clear()
    assert not found.amplitude.any()  # the fit under noise alone is the one beside a discrepancy
    explanation.fit_shapes(problem, [replace(found, noise_only=found.fit), found])
    assert len(asked) == 2


def test_shapes_start_from_the_free_law_of_an_earlier_search(dug, monkeypatch):
    problem, found = dug
    (before,) = explanation.fit_shapes(problem, [found])
    asked = []

    def fitted(problem, started, lowest):
        asked.extend(started)
        return [None] * len(started)

    monkeypatch.setattr(explanation, "fit_marginal", fitted)
    again = replace(found, noise_only=replace(found.fit))
    explanation.fit_shapes(problem, [again], {found.names: before})
    ((start, amplitude),) = asked
    assert start.start == before.free_law.fit.start_values()
    assert amplitude is before.free_law.evidence.amplitude
    assert start.near is before.free_law.fit.linearisation
    assert start.useful == again.catalogue_law.evidence.value + 2.0
    assert [c.path for c in start.coordinates] == [c.path for c in before.free_law.fit.coordinates]
    asked.clear()
    explanation.fit_shapes(problem, [again], {found.names: found})  # it had no free law
    assert len(asked) == 2


def test_shapes_of_a_larger_set_start_from_those_of_what_it_extends(dug, monkeypatch):
    problem, found = dug
    (base,) = explanation.fit_shapes(problem, [found])
    larger = candidate(problem, ["slip-sinkage", "torque-gain"], {})
    asked = []
    monkeypatch.setattr(explanation, "fit_marginal", lambda _, s, low: asked.extend(s) or [None])
    explanation.fit_shapes(problem, [larger], {larger.names: base})
    ((start, amplitude),) = asked
    assert amplitude is base.free_law.evidence.amplitude
    own = larger.catalogue_law.fit.start_values()
    (new,) = own.keys() - base.free_law.fit.start_values().keys()  # the size of torque-gain
    assert start.start == {**base.free_law.fit.start_values(), new: own[new]}


def test_a_candidate_keeps_its_fit_under_noise_alone(dug):
    problem, found = dug
    none = np.zeros(len(problem.readings.channels))
    starts = [None, {}]
    one, two = explanation.fit_candidates(
        problem, [explanation.CandidateRequest(("slip-sinkage",), {}, none, s) for s in starts]
    )
    assert one.noise_only is None and two.noise_only is not None
    white = problem.covariance.whiten
    by_noise = two.noise_only.whitened_by(white)
    beside = found.fit.whitened_by(white)
    assert np.sum(by_noise.residual**2) <= np.sum(beside.residual**2)


def test_of_two_fits_the_one_of_larger_evidence_is_kept():
    none = np.zeros(1)
    first, second = (
        MarginalFit(SimpleNamespace(), Evidence(value, none, none, none)) for value in (1.0, 2.0)
    )
    assert _better(first, second) is _better(second, first) is first
    assert _better(None, second) is _better(second, None) is second
    assert _better(None, None) is None


def test_the_plain_fit_is_an_optimum_under_noise_alone_no_worse_than_the_soil_alone(dug):
    problem, found = dug
    soil = problem.fit_soil([np.full(3, 0.5)])
    plain = plain_fit(problem, soil, found)
    assert plain.converged and plain.objective < soil.objective
    assert [c.path for c in plain.coordinates] == [c.path for c in found.fit.coordinates]
    again = problem.fit(plain.case, plain.coordinates, plain.start_values())
    assert plain.objective == pytest.approx(again.objective, abs=0.02)
    assert plain_fit(problem, soil, SimpleNamespace(fit=soil)).objective <= soil.objective
