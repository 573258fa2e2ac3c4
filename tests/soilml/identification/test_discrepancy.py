"""Identification where the model has a smooth error of its own: intervals include it."""

from dataclasses import replace

import numpy as np
import pytest
from remarked import remarked

from soilml import Operating, identify
from soilml.config.measurement_noise import Discrepancy, Noise, range_with_zero
from soilml.config.remainder import Remainder, RemainderPart
from soilml.experiment_design.expected_variance import predicted_readings
from soilml.experiment_design.parameter_samples import samples_of_prior
from soilml.fitting.coordinates import select_free
from soilml.identification.model_error_inputs import with_model_error
from soilml.io.table import Table
from soilml.remarks import texts

TRUTH = {"cohesion": 812.0, "friction_angle": 0.6, "shear_modulus": 0.012}
COLUMNS = {"torque_Nm": "torque", "drawbar_pull_N": "drawbar_pull", "sinkage_m": "sinkage"}
SLIPS, LOADS = np.tile(np.linspace(0.05, 0.6, 6), 3), np.repeat([40.0, 70.0, 120.0], 6)
USUAL = {key: Discrepancy(share=0.02) for key in COLUMNS}


def smooth_function(rng, slip, load):
    """A sum of cosines of unit variance, with correlation lengths half to twice the usual ones."""
    scale = 2.0 ** rng.uniform(-1.0, 1.0, 2) * [0.3, 0.6]
    wave = rng.standard_normal((200, 2)) / scale
    phase = np.column_stack([slip, np.log(load)]) @ wave.T + rng.uniform(0.0, 2.0 * np.pi, 200)
    return np.sqrt(2.0 / 200) * np.cos(phase).sum(axis=1)


def measured(case, truth, rng, error=0.02, noise=0.01):
    """Rows with a smooth error and noise, shares of each channel's range; the noise in a case."""
    true = case.with_values(truth)
    force = true.model(true.soil, Operating(slip=SLIPS, load=LOADS))
    table, declared = {"slip": SLIPS, "load_N": LOADS}, {}
    for key, name in COLUMNS.items():
        y = np.asarray(getattr(force, name))
        span = range_with_zero(y)
        smooth = smooth_function(rng, SLIPS, LOADS)
        table[key] = y + span * (error * smooth + noise * rng.standard_normal(y.size))
        declared[key] = Noise(constant=noise * span)
    return replace(case, noise=declared), Table(table)


def test_a_declared_error_widens_the_intervals_and_explains_the_residuals(case):
    case, table = measured(case, TRUTH, np.random.default_rng(4))
    assert remarked(identify(case, table, method="nonlinear").warnings, "times the declared noise")
    fit = identify(replace(case, discrepancy=USUAL), table, method="nonlinear")
    assert not remarked(fit.warnings, "times the declared noise")
    noise_only = identify(
        *measured(case, TRUTH, np.random.default_rng(4), error=0.0), method="nonlinear"
    )
    assert (fit.std > 1.5 * noise_only.std).all()
    assert (np.abs(fit.values - list(TRUTH.values())) < 3.0 * fit.std).all()


def test_no_discrepancy_and_one_of_zero_give_the_same_fit(case):
    case, table = measured(case, TRUTH, np.random.default_rng(5), error=0.0)
    plain = identify(case, table, method="nonlinear")
    zero = identify(
        replace(case, discrepancy=dict.fromkeys(COLUMNS, Discrepancy())), table, method="nonlinear"
    )
    assert zero.values == pytest.approx(plain.values)
    assert zero.std == pytest.approx(plain.std)
    assert zero.warnings == plain.warnings


def test_a_closed_form_says_that_it_ignores_the_discrepancy(case):
    case, table = measured(case, TRUTH, np.random.default_rng(6), error=0.0)
    fit = identify(replace(case, discrepancy=USUAL), table, method="linear")
    said = "the linear method ignores the [discrepancy] of torque_Nm, drawbar_pull_N, sinkage_m"
    assert any(text.startswith(said) for text in texts(fit.warnings))


def test_readings_of_a_next_row_have_the_error_of_the_model_too(case):
    samples = samples_of_prior(select_free(case, None))
    at = Operating(slip=np.asarray([0.1, 0.4]), load=np.asarray([60.0, 60.0]))
    plain = predicted_readings(case, samples, at)
    wide = predicted_readings(replace(case, discrepancy=USUAL), samples, at)
    added = np.sqrt(wide.std**2 - plain.std**2)
    typical = np.median(plain.y[0], axis=1).max()
    assert added == pytest.approx(0.02 * typical)


def test_rows_estimated_together_have_larger_errors_the_more_alike_they_are():
    readings = {"slip": np.asarray([0.1, 0.1, 5.0]), "load": np.full(3, 60.0)}
    readings["torque"] = np.asarray([0.0, 5.0, 10.0])
    noise = {"torque": (0.3, 0.0)}
    discrepancy = {"torque_Nm": Discrepancy(constant=0.4)}
    single = with_model_error(discrepancy, None, readings, noise, together=False)
    assert single["torque_std"] == pytest.approx(0.5)
    pooled = with_model_error(discrepancy, None, readings, noise, together=True)
    alike = np.hypot(0.3, 0.4 * np.sqrt(2.0))
    assert pooled["torque_std"] == pytest.approx([alike, alike, 0.5])
    own = {"torque_std": np.full(3, 1.2)}
    assert with_model_error(discrepancy, None, readings | own, noise, together=False)[
        "torque_std"
    ] == pytest.approx(np.hypot(1.2, 0.4))


def learned():
    """A remainder of the torque that is known at two slips under one load."""
    part = RemainderPart(
        "torque_Nm", 0.3, 0.6, 0.3, 0.6, (0.1, 0.4), (60.0, 60.0),
        ((0.1, 60.0), (0.4, 60.0)), (1.0, 0.5), ((0.9, 0.0), (0.0, 0.9)), ((0.1,), (0.0,)),
    )  # fmt: skip
    return Remainder((part,))


def test_an_estimate_takes_the_mean_of_a_remainder_from_the_readings():
    """Alone each row has the variance of the process; together they have no less than it."""
    readings = {"slip": np.asarray([0.1, 0.2, 0.4]), "load": np.asarray([60.0, 60.0, 5000.0])}
    readings["torque"] = np.asarray([1.0, 5.0, 10.0])
    at, noise = (readings["slip"], readings["load"]), {"torque": (0.3, 0.0)}
    mean, _ = learned().mean_and_std("torque", *at)
    columns = learned().process_columns("torque", *at, fitted_anew=True)
    single = with_model_error({}, learned(), readings, noise, together=False)
    assert single["torque"] == pytest.approx(readings["torque"] - mean)
    assert single["torque_std"] ** 2 == pytest.approx(0.09 + (columns**2).sum(axis=1))
    # far from its range the mean has faded, and the error is a usual one
    assert single["torque"][2] == pytest.approx(10.0, abs=1e-3)
    assert single["torque_std"][2] == pytest.approx(np.hypot(0.3, 0.6), rel=1e-3)
    pooled = with_model_error({}, learned(), readings, noise, together=True)
    independent = np.diag(pooled["torque_std"] ** 2 - 0.09)
    assert np.linalg.eigvalsh(independent - columns @ columns.T).min() > -1e-9
    # a file that takes no noise of a row gets the mean alone; a declared error of torque is unused
    bare = with_model_error(USUAL, learned(), readings, None, together=True)
    assert bare.keys() == readings.keys()
    assert bare["torque"] == pytest.approx(single["torque"])


def test_readings_of_a_next_row_have_the_error_of_a_remainder(case):
    samples = samples_of_prior(select_free(case, None))
    at = Operating(slip=np.asarray([0.1, 0.4]), load=np.asarray([60.0, 2000.0]))
    plain = predicted_readings(case, samples, at)
    wide = predicted_readings(replace(case, remainder=learned()), samples, at)
    columns = learned().process_columns("torque", at.slip, at.load, fitted_anew=True)
    error = np.sqrt((columns**2).sum(axis=1))
    assert error[1] > 1.9 * error[0]  # a usual one, far from the range
    torque = plain.channels.index("torque")
    carried = np.isfinite(plain.y[torque]).all(axis=0)
    for k in (0, 1):
        noise = np.hypot(case.noise["torque_Nm"].std(wide.y[torque, k]), error[k])
        assert wide.std[torque, k][carried] == pytest.approx(noise[carried], rel=1e-6)


@pytest.mark.slow
def test_methods_agree_where_the_model_has_an_error(case):
    case, table = measured(case, TRUTH, np.random.default_rng(7))
    case = replace(case, discrepancy=USUAL)
    least_squares, exact = (
        identify(case, table, method="nonlinear"),
        identify(case, table, method="posterior"),
    )
    assert (np.abs(least_squares.values - exact.values) < 0.5 * exact.std).all()
    assert least_squares.std == pytest.approx(exact.std, rel=0.3)


@pytest.mark.slow
def test_intervals_hold_the_truth_although_the_error_has_other_lengths(case):
    rng = np.random.default_rng(8)
    inside = {"with": [], "without": []}
    for _ in range(24):
        truth = {n: float(p.at(rng.random())) for n, p in case.prior.items()}
        noisy, table = measured(case, truth, rng)
        for name, discrepancy in (("with", USUAL), ("without", {})):
            low, high = identify(
                replace(noisy, discrepancy=discrepancy), table, method="nonlinear"
            ).interval
            inside[name].append((low <= list(truth.values())) & (high >= list(truth.values())))
    # 0.90 expected of 72 intervals, which are correlated in threes: 0.78 is two sigma below
    assert np.mean(inside["with"]) > 0.78
    assert np.mean(inside["without"]) < 0.78
