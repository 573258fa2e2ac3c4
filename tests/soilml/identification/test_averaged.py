"""The soil averaged over explanations, beside densities by dense matrices and wrong sensors."""

from dataclasses import replace

import numpy as np
import pytest

from datagen.recipe import read_recipe
from soilml import Operating, Table, identify
from soilml.config.measurement_noise import Discrepancy, Noise
from soilml.errors import FitError
from soilml.fitting.candidate_effects import candidate_effects
from soilml.fitting.coordinates import select_free
from soilml.fitting.effect_signatures import effect_signatures
from soilml.fitting.usable_readings import usable_readings
from soilml.identification import averaged_fit
from soilml.identification.averaged import averaged_samples
from soilml.identification.hypotheses import ErrorHypothesis, fit_hypothesis
from soilml.physics.effects import EFFECTS
from soilml.physics.effects.friction_drift import FrictionDrift
from soilml.quantities import SHEAR

CASE = read_recipe("wheel").case
SLIP, LOAD = np.tile([0.1, 0.25, 0.4, 0.6], 3), np.repeat([40.0, 70.0, 100.0], 4)
COLUMNS = {"torque_Nm": "torque", "drawbar_pull_N": "drawbar_pull", "sinkage_m": "sinkage"}
TRUTH = np.asarray([1040.0, 0.55, 0.018])


def rows(columns=COLUMNS, seed=0, slip_offset=0.0, factor=1.0):
    """Rows of the truth, slip read too high by an offset, readings multiplied."""
    true = CASE.with_values(dict(zip(SHEAR, TRUTH, strict=True)))
    force = true.model(true.soil, Operating(slip=SLIP - slip_offset, load=LOAD))
    rng, found = np.random.default_rng(seed), {"slip": SLIP, "load_N": LOAD}
    for key, name in columns.items():
        y = factor * getattr(force, name)
        found[key] = y + CASE.noise[key].std(y) * rng.standard_normal(len(y))
    return Table(found)


def density_of(hypothesis, table):
    data, free = usable_readings(CASE, table), select_free(CASE, list(SHEAR))
    return fit_hypothesis(hypothesis, CASE, data, free, candidate_effects(CASE, EFFECTS), {})


def covariance_of(density):
    """S as a dense matrix."""
    columns = np.hstack([density.columns, density.other_columns])
    return np.diag(density.std**2) + columns @ columns.T


def test_the_density_is_that_of_a_dense_covariance():
    density = density_of(ErrorHypothesis(1.0, 0.5), rows())
    u = np.asarray([[0.3, 0.4, 0.5], [0.6, 0.2, 0.7]])
    y = density.predict(u)
    matrix = covariance_of(density)
    left = density.optimum.measured - y + density.offset
    expected = -0.5 * np.einsum("ni,ni->n", left, np.linalg.solve(matrix, left.T).T)
    expected -= 0.5 * np.linalg.slogdet(matrix)[1]
    np.testing.assert_allclose(density.of_predictions(y), expected, rtol=1e-9)


def test_the_evidence_by_laplace_is_that_of_samples():
    density = density_of(ErrorHypothesis(1.0, 0.25), rows())
    assert density.sample().evidence == pytest.approx(density.log_evidence, abs=0.4)


def test_the_gain_of_an_effect_is_that_of_one_more_column():
    density = density_of(ErrorHypothesis(1.0, 0.5), rows())
    free = candidate_effects(CASE, EFFECTS)
    readings = density.optimum.problem.readings
    signatures, _ = effect_signatures(density.optimum.fitted(), readings, free)
    column = next(s.column for s in signatures if s.name == "slip-offset")
    more = replace(density, columns=np.column_stack([density.columns, 2.0 * column]))

    def integral(own):
        """Of the density over the soil, linearised, with its residuals at the optimum."""
        slope = own.jacobian.T @ own.residual
        best = 0.5 * slope @ np.linalg.solve(own.precision, slope)
        return own.log_evidence + best

    gain, _ = density.gain(column, 2.0, 0)
    assert gain == pytest.approx(integral(more) - integral(density), abs=0.02)
    one_sided = [density.gain(column, 2.0, sign)[0] for sign in (-1, 1)]
    assert np.logaddexp(*one_sided) - np.log(2.0) == pytest.approx(gain)


@pytest.mark.slow
def test_the_average_holds_the_truth_where_a_sensor_is_wrong():
    fit = identify(CASE, rows(slip_offset=0.03))
    assert fit.method == "averaged" and sum(
        one.probability for one in fit.explanations
    ) == pytest.approx(1.0)
    held = (fit.interval[0] <= TRUTH) & (fit.interval[1] >= TRUTH)
    exact = fit.exact_model
    assert held.all()
    assert not ((exact.interval[0] <= TRUTH) & (exact.interval[1] >= TRUTH)).all()
    content = fit.as_json()
    assert content["exact_model"]["parameters"].keys() == content["parameters"].keys()


@pytest.mark.slow
def test_the_average_is_little_wider_where_the_model_is_right():
    fit = identify(CASE, rows(seed=3))
    ratio = fit.std / fit.exact_model.std
    assert (ratio > 1.0).all() and ratio.mean() < 3.0
    assert fit.exact_model.use_of_exact.text.startswith("use exact_model only where")


@pytest.mark.slow
def test_a_drift_of_the_soil_is_an_explanation_where_the_order_of_the_rows_is_known():
    order = np.random.default_rng(6).permutation(2 * len(SLIP)) % len(SLIP)
    table = rows()
    columns = {name: values[order] for name, values in table.columns.items()}
    case = CASE.with_values(dict(zip(SHEAR, TRUTH, strict=True)))
    at = Operating(slip=SLIP[order], load=LOAD[order], progress=np.linspace(0.0, 1.0, len(order)))
    drifting = (case.model + FrictionDrift(gain=0.2))(case.soil, at)
    columns |= {key: np.asarray(getattr(drifting, name)) for key, name in COLUMNS.items()}
    assert identify(CASE, Table(columns)).explanations[0].effect == "friction-drift"


@pytest.mark.slow
def test_rows_that_nothing_explains_are_said_to_be_so():
    rng = np.random.default_rng(1)
    fit = identify(CASE, rows(factor=rng.uniform(0.3, 1.7, len(SLIP))))
    assert "excess-residuals" in {remark.code for remark in fit.warnings}


@pytest.mark.slow
def test_a_case_that_states_its_error_has_one_explanation():
    case = replace(CASE, discrepancy={"torque_Nm": Discrepancy(share=0.02)})
    fit = identify(case, rows({"torque_Nm": "torque"}))
    assert fit.exact_model is None and not fit.explanations and fit.method == "posterior"


@pytest.mark.slow
def test_where_averaging_fails_the_exact_model_answers_and_says_so(monkeypatch):
    def refuse(*args):
        raise FitError("no equilibrium")

    monkeypatch.setattr(averaged_fit, "averaged_samples", refuse)
    fit = identify(CASE, rows({"torque_Nm": "torque"}))
    assert fit.method == "posterior" and fit.warnings[0].code == "not-averaged"


@pytest.mark.slow
def test_noise_that_is_not_declared_is_that_of_the_residuals():
    case = replace(CASE, noise={})
    fit = identify(case, rows({"torque_Nm": "torque"}))
    assert fit.method == "averaged" and fit.exact_model.method == "nonlinear"
    assert "undeclared-noise" in {remark.code for remark in fit.warnings}


def test_a_soil_that_carries_no_load_has_no_explanation():
    table = Table({"slip": SLIP, "load_N": 1e3 * LOAD, "torque_Nm": LOAD})
    data, free = usable_readings(CASE, table), select_free(CASE, list(SHEAR))
    with pytest.raises(FitError, match="no parameters in the prior carry"):
        averaged_samples(CASE, data, free)


def test_declared_errors_are_not_scaled():
    case = replace(CASE, bias={"slip": Noise(constant=0.01)})
    data, free = usable_readings(case, rows()), select_free(case, list(SHEAR))
    errors = ErrorHypothesis(1.0, 0.5).errors_of(case, data, free)
    assert errors["slip_bias"] == 0.01 and errors["load_gain"] == pytest.approx(0.005)
    assert ErrorHypothesis(1.0).errors_of(case, data, free) == {"slip_bias": 0.01}


@pytest.mark.slow
def test_rows_of_another_model_speak_against_the_exact_one():
    fit = identify(CASE, rows(slip_offset=0.08))
    assert fit.exact_model.use_of_exact.text.startswith("the model misfits these rows")
