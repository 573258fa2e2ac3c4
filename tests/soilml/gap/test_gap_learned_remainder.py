"""What the analysis learns beside soil and effects, and the model that carries it."""

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from gap_sets import case_of, driven, fit_problem

from soilml import read_case
from soilml.config.measurement_noise import Discrepancy
from soilml.config.write_case import case_as_toml
from soilml.fitting.predictions import predict
from soilml.fitting.readings import stack_readings
from soilml.gap import gap
from soilml.gap.evidence.problem import MarginalFit
from soilml.gap.verdict.estimates import updated_case
from soilml.gap.verdict.learned_remainder import learned_remainder, without_learned_discrepancy
from soilml.gap.verdict.remainder import posterior_discrepancy
from soilml.io.table import Table


def with_wave(table, size=0.05):
    """Torque and pull changed smoothly, by 5 % of their range, in a way that no effect has."""
    columns = dict(table.columns)
    wave = np.sin(9.0 * columns["slip"] + 2.0 * np.log(columns["load_N"] / 80.0))
    for key in ("torque_Nm", "drawbar_pull_N"):
        columns[key] = columns[key] + size * np.ptp(columns[key]) * wave
    return Table(columns)


@pytest.fixture(scope="module")
def fitted():
    """A soil fitted to such rows, beside a discrepancy of three times the usual size."""
    case = case_of()
    problem = fit_problem(case, with_wave(driven(case)))
    soil = problem.fit_soil([np.full(len(problem.soil), 0.5)])
    evidence = problem.discrepancy.evidence(soil)
    amplitude = np.asarray([3.0, 3.0, 0.0])
    return problem, MarginalFit(soil, replace(evidence, amplitude=amplitude))


def test_its_mean_is_the_posterior_discrepancy_of_the_fit(fitted):
    problem, marginal = fitted
    readings, found = problem.readings, learned_remainder(problem, marginal)
    assert found.columns == ["torque_Nm", "drawbar_pull_N"]
    expected = posterior_discrepancy(problem, marginal)
    for i, name in enumerate(readings.channels):
        own = readings.channel == i
        mean, std = found.mean_and_std(name, readings.slip[own], readings.load[own])
        noise = problem.covariance.std[own]
        assert np.abs(mean - expected[own]).max() < 0.2 * noise.max()
        if found.of(name):
            assert np.mean(std < noise) > 0.9  # neighbouring readings tell of it too


def test_the_error_is_the_one_that_rows_kept_back_have(fitted):
    """Of a fit's own process, at points between the readings."""
    problem, marginal = fitted
    (part,) = learned_remainder(problem, marginal).of("torque")
    slip, load = np.asarray([0.2, 0.35]), np.asarray([50.0, 110.0])
    readings = problem.readings
    own = readings.channel == 0
    z = part.scaled(np.append(slip, readings.slip[own]), np.append(load, readings.load[own]))
    prior = part.amplitude**2 * np.exp(-0.5 * ((z[:, None] - z) ** 2).sum(axis=-1))
    noise = problem.covariance.matrix[np.ix_(own, own)]
    given = np.linalg.inv(prior[2:, 2:] + noise)
    exact = np.diag(prior[:2, :2] - prior[:2, 2:] @ given @ prior[2:, :2])
    np.testing.assert_allclose(part.mean_and_std(slip, load)[1] ** 2, exact, rtol=0.3)
    anew = part.columns(slip, load, fitted_anew=True)
    assert np.all((anew**2).sum(axis=1) > exact)  # the soil may take a part of it


def test_a_further_analysis_counts_it_once(fitted):
    problem, marginal = fitted
    found = learned_remainder(problem, marginal)
    declared = {"torque_Nm": Discrepancy(0.1), "sinkage_m": Discrepancy(0.001)}
    case = replace(problem.case, remainder=found, discrepancy=declared)
    assert list(without_learned_discrepancy(case).discrepancy) == ["sinkage_m"]
    again = learned_remainder(replace(problem, case=case), marginal)
    assert again.parts[:2] == found.parts
    assert len(again.parts) == 4


def test_a_further_analysis_leaves_out_the_discrepancy_that_an_earlier_one_learned(fitted):
    """Without a remainder too: where the soil alone is returned, only its error is stated."""
    problem, marginal = fitted
    found = updated_case(marginal.fit, {"torque_Nm": 0.1}).discrepancy
    assert found == {"torque_Nm": Discrepancy(0.1, learned=True)}
    declared = {"sinkage_m": Discrepancy(0.001)}
    case = replace(problem.case, remainder=None, discrepancy=found | declared)
    assert without_learned_discrepancy(case).discrepancy == declared


@pytest.mark.long
def test_the_returned_model_predicts_rows_kept_back_and_leaves_little_to_find():
    case = case_of()
    table = with_wave(driven(case, slips=12))
    kept = np.arange(len(table)) % 5 == 2
    report = gap(case, table.rows(~kept))
    assert report.model.remainder is not None
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.toml"
        path.write_text(case_as_toml(report.model))
        model = read_case(path)
    assert model == report.model
    again = gap(model, with_wave(driven(case, slips=12, seed=1)).rows(~kept))
    for key, first in report.discrepancy.items():  # what is left to find is a part of a sigma
        left = again.discrepancy[key].after_sigma if again.discrepancy else 0.0
        assert left < max(0.4 * first.after_sigma, 0.5)
    assert again.model.remainder.parts[: len(model.remainder.parts)] == model.remainder.parts
    readings = stack_readings(case, table.rows(kept))
    soil = case.with_values({k: v.value for k, v in report.soil_before.items()})
    errors = [
        (readings.measured - predict(c, [], np.zeros((1, 0)), readings)[0]) / readings.std
        for c in (soil, model)
    ]
    of_soil, of_model = (float(np.sqrt(np.mean(e**2))) for e in errors)
    assert of_model < 0.5 * of_soil
