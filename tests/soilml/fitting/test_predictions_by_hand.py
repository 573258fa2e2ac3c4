"""Noise, shared errors, densities and steps of the fits against their formulas."""

from dataclasses import replace

import numpy as np
import pytest
from channel_readings import LOAD, SLIP, channel_readings, rows_of
from scipy.stats import multivariate_normal

from soilml import Operating, read_case
from soilml.config.measurement_noise import Discrepancy, Noise
from soilml.errors import FitError
from soilml.fitting.coordinates import select_free
from soilml.fitting.covariance import discrepancy_process, noise_of_operation, sensor_columns
from soilml.fitting.predictions import linearise, predict_channels
from soilml.fitting.shared_errors import (
    ModelledErrors,
    errors_at,
    usual_errors,
    with_modelled_errors,
    without_errors,
)
from soilml.fitting.usable_readings import usable_readings
from soilml.identification.posterior_density import PosteriorDensity, _stacked
from soilml.io.table import Table
from soilml.physics.gears import GEARS
from soilml.physics.gears.rigid_wheel import WheelArc
from soilml.physics.load_case import LoadCase


@pytest.fixture
def case(model_file):
    return read_case(model_file)


def test_relative_noise_is_that_of_the_prediction_and_given_noise_stays(case):
    torque = np.asarray([1.0, 2.0, 4.0, np.nan])
    noise = Noise(constant=0.1, share=0.1)
    own = noise.std(torque)
    own[1] = 0.7  # as the table gives it
    channels = {"torque": (torque, own), "sinkage": (np.ones(4), np.ones(4))}
    rows = channel_readings(Operating(slip=SLIP, load=LOAD), channels, noise=(noise, None))
    rows = replace(rows, from_case=rows.std != 0.7)
    prediction = np.asarray([[2.0, 3.0, 5.0, *4 * (9.0,)], [np.nan, 3.0, 1.0, *4 * (8.0,)]])
    found = rows.noise_at(prediction)
    expected = [[*noise.std(np.asarray([2.0, 0, 5.0])), 1], [own[0], 0, float(noise.std(1.0)), 1]]
    expected[0][1] = expected[1][1] = 0.7
    np.testing.assert_allclose(found[0], [*expected[0][:3], 1, 1, 1, 1], rtol=1e-12)
    np.testing.assert_allclose(found[1], [*expected[1][:3], 1, 1, 1, 1], rtol=1e-12)


def test_noise_of_slip_and_load_is_the_slope_times_its_size(case):
    at, free = Operating(slip=SLIP, load=LOAD), select_free(case, ["cohesion"])
    u, small = np.asarray([0.3]), 1e-4
    slip_std, load_std = np.asarray([0.01, 0.0, 0.02, 0.01]), np.asarray([0.5, 1.0, 0.0, 2.0])
    rows = channel_readings(at, {"torque": (np.ones(4), 1.0)}, slip_std=slip_std, load_std=load_std)
    found = noise_of_operation(case, rows, free, u)

    def torque(slip, load):
        return predict_channels(case, free, u[None], replace(at, slip=slip, load=load))["torque"]

    by_slip = (torque(SLIP + small, LOAD) - torque(SLIP - small, LOAD)) / (2 * small)
    by_load = (torque(SLIP, LOAD + small) - torque(SLIP, LOAD - small)) / (2 * small)
    expected = np.hypot(by_slip * slip_std, by_load * load_std)
    np.testing.assert_allclose(found, expected[0], rtol=2e-3)
    none = replace(rows, slip_std=np.zeros(4), load_std=np.zeros(4))
    assert not noise_of_operation(case, none, free, u).any()
    # rows are moved only as far as the model reaches
    wild = replace(rows, slip_std=np.full(4, 3.0), load_std=3.0 * LOAD)
    by_slip = torque(np.full(4, 0.999), LOAD) - torque(np.full(4, -0.999), LOAD)
    by_load = torque(SLIP, 2.0 * LOAD) - np.nan_to_num(torque(SLIP, 1e-3 * LOAD))
    expected = np.hypot(by_slip, by_load)
    np.testing.assert_allclose(noise_of_operation(case, wild, free, u), expected[0], rtol=1e-9)


def test_a_jacobian_is_that_of_differences_and_points_away_from_a_bound(case):
    free, data = select_free(case, None), rows_of(case)
    for u in (np.asarray([0.3, 0.6, 0.5]), np.ones(3), np.zeros(3)):
        found = linearise(case, free, u, data)
        for i in range(3):
            h = 1e-4 * np.eye(3)[i] * (1.0 if u[i] < 1.0 else -1.0)
            ends = np.stack([u + h, u + 2.0 * h])
            y = predict_channels(case, free, ends, data.at)
            y = np.hstack([y["torque"], y["sinkage"][:, 1:]])
            slope = (4.0 * y[0] - y[1] - 3.0 * found.prediction) / (2.0 * h[i])
            np.testing.assert_allclose(found.jacobian[:, i], slope, rtol=2e-3, atol=1e-5)
        moved = found.sinkage_at((0.0005 - u * 0.001)[None, :])
        np.testing.assert_allclose(moved.log_sinkage[0], found.log_sinkage, atol=1e-2)
    assert found.log_sinkage_rate.shape == (3, 4) and found.slope.shape == (4,)


def test_gains_and_offsets_change_the_readings_of_their_sensor_alone(case):
    sizes = {"torque_gain": 0.03, "torque_bias": 0.2, "sinkage": 0.04, "sinkage_bias": 5e-4}
    data = rows_of(case, shared_errors=sizes | {"drawbar_pull_bias": 9.0, "slip_bias": 1.0})
    y = np.arange(1.0, 15.0).reshape(2, 7)
    found = sensor_columns(data, y)
    zero3, zero4 = np.zeros((2, 3)), np.zeros((2, 4))
    expected = [
        np.hstack([0.03 * y[:, :4], zero3]),
        np.hstack([0.2 + zero4, zero3]),
        np.hstack([zero4, 0.04 * y[:, 4:]]),
        np.hstack([zero4, 5e-4 + zero3]),
    ]
    np.testing.assert_allclose(found, np.stack(expected, axis=-1))
    assert sensor_columns(rows_of(case, shared_errors={"slip_bias": 1.0}), y) is None
    pull = {"drawbar_pull": (np.asarray([1.0, np.nan, 2.0, 3.0]), 1.0)}
    errors = {"drawbar_pull": 0.02, "drawbar_pull_bias": 0.6}
    rows = channel_readings(Operating(slip=SLIP, load=LOAD), pull, shared_errors=errors)
    found = sensor_columns(rows, y[:1, :3])
    np.testing.assert_allclose(found[0, :, 0], 0.02 * LOAD[[0, 2, 3]])
    np.testing.assert_allclose(found[0, :, 1], 0.6)


def test_errors_of_the_model_become_parameters_behind_those_of_the_soil(case):
    errors = {"slip_bias": 0.015, "torque_gain": 0.1, "bearing": 0.4}
    free = select_free(case, None)
    changed, every = with_modelled_errors(case, errors, LOAD, free)
    assert [f.path for f in every[3:]] == ["modelled-errors.slip_bias", "modelled-errors.bearing"]
    assert every[4].prior.lower == -1.6 and every[4].prior.upper == 1.6
    assert every[4].nominal == 0.0 and not every[4].assumed and every[4].normal_std == 0.4
    assert changed.model.effects[-1].typical_load == 75.0
    u = np.asarray([[0.1, 0.2, 0.3, 0.5, 0.75], [0.1, 0.2, 0.3, 0.0, 1.0]])
    np.testing.assert_allclose(errors_at(every, u), [[0.0, 2.0], [-4.0, 4.0]], atol=1e-12)
    assert with_modelled_errors(case, {}, LOAD, free) == (case, free)


def test_errors_of_slip_bearing_and_contact_are_as_written(case):
    at = Operating(slip=np.asarray([0.2, -0.3, 0.99]), load=np.asarray([50.0, 100.0, 60.0]))
    scene = LoadCase(case.model.gear, case.soil, at)
    moved = ModelledErrors(slip_bias=0.05, load_gain=0.1).on_operating(at, scene)
    np.testing.assert_allclose(moved.slip, [0.25, -0.25, 1.0], atol=1e-6)
    assert moved.slip[2] < 1.0 and moved.load.tolist() == pytest.approx([55.0, 110.0, 66.0])
    low = ModelledErrors(slip_bias=-0.9).on_operating(at, scene).slip
    assert low[1] > -1.0 and low[1] == pytest.approx(-1.0)
    effect = ModelledErrors(bearing_by_slip=0.8, bearing_by_load=0.2, typical_load=50.0)
    soil = effect.on_soil(case.soil, scene)
    factor = np.exp(0.8 * np.abs(at.slip)) * (at.load / 50.0) ** 0.2
    np.testing.assert_allclose(soil.kphi, case.soil.kphi * factor)
    np.testing.assert_allclose(soil.kc, case.soil.kc * factor)
    one = np.ones(3)
    rim = WheelArc(0.5 * one, 0.0 * one, 0.2 * one, 0.02 * one, 0.15, 0.15, 0.15, 0.12)
    usual = np.arccos(1.0 - 0.15 * 0.02 / 0.15)
    behind = ModelledErrors(contact=2.0).on_contact(rim, scene).exit
    np.testing.assert_allclose(behind, -2.0 * usual, rtol=1e-9)
    for error, share in ((-0.1, 0.1 * usual), (-50.0, 0.2)):
        ahead = ModelledErrors(contact=error).on_contact(rim, scene).exit
        np.testing.assert_allclose(ahead, share, rtol=2e-3)
        assert (ahead < 0.2).all()
    ratio = usual / 0.2
    ahead = ModelledErrors(contact=-1.0).on_contact(rim, scene).exit
    np.testing.assert_allclose(ahead, usual / (1.0 + ratio**4) ** 0.25, rtol=1e-9)
    assert ModelledErrors(contact=1.0).on_contact("another", scene) == "another"


def test_errors_that_a_model_knows_are_no_usual_ones(case):
    wheels, track = [case.model.gear], [GEARS["track"](radius=0.1, width=0.1, base=0.6)]
    assert without_errors([], [], wheels) == set()
    assert without_errors(["kc"], [], wheels) == {"bearing"}
    assert without_errors(["n"], [], wheels) == {"bearing_by_load"}
    assert without_errors(["slip-sinkage.n1"], [], wheels) == {"bearing_by_slip"}
    assert without_errors([], ["exit-angle"], wheels) == {"contact"}
    assert without_errors([], [], [*wheels, *track]) == {"contact"}
    biased = replace(case, bias={"torque_Nm": Noise(constant=0.3)})
    found = usual_errors(biased, LOAD, [])
    assert found["torque_bias"] == 0.3 and "torque_gain" not in found
    assert found["drawbar_pull_bias"] == pytest.approx(0.01 * 75.0)


def test_the_log_density_is_that_of_a_normal_with_noise_and_shared_errors(case):
    wide = Discrepancy(constant=0.1, slip_length=0.2, log_load_length=0.5)
    known = replace(case, discrepancy={"torque_Nm": wide}, noise={"torque_Nm": Noise(0.01, 0.05)})
    data = rows_of(case, shared_errors={"torque_gain": 0.1, "slip_bias": 0.02})
    noise = known.noise["torque_Nm"]
    std = np.where(data.channel == 0, noise.std(data.measured), data.std)
    data = replace(data, std=std, noise=(noise, None))
    density = PosteriorDensity(known, data, select_free(known, None), noise_scale=1.5)
    assert density.errors == 1
    u = np.asarray([[0.3, 0.5, 0.6, 0.5], [0.6, 0.4, 0.3, 0.6], [0.5, 0.5, 0.5, 0.3]])
    y = density.predict(u)[:, :7]
    points = np.stack([SLIP / 0.2, np.log(LOAD) / 0.5])
    far = ((points[:, :, None] - points[:, None, :]) ** 2).sum(axis=0)
    expected = []
    for one, prediction in zip(u, y, strict=True):
        covariance = np.diag([*known.noise["torque_Nm"].std(prediction[:4]) ** 2, *3 * (1e-6,)])
        covariance[:4, :4] += 0.1**2 * np.exp(-0.5 * far)
        gain = np.where(np.arange(7) < 4, 0.1 * prediction, 0.0)
        covariance += np.outer(gain, gain)
        log = multivariate_normal(np.zeros(7), 1.5**2 * covariance).logpdf(
            prediction - data.measured
        )
        error = 8.0 * (one[3] - 0.5)
        expected.append(log - 0.5 * error**2 / 1.5**2)
    found = density(u)
    np.testing.assert_allclose(found - found[0], np.asarray(expected) - expected[0], rtol=2e-3)
    part = density.of_rows(np.asarray([1, 2]))
    assert len(part.measured) == 2 + 2 + 1 and part.columns[0].shape[0] == 2
    assert density(np.zeros((0, 4))).shape == (0,)
    with pytest.raises(FitError, match=r"needs the noise of sinkage_m: .*sinkage_m = '3 %'"):
        undeclared = replace(data, std=np.where(data.channel == 1, np.nan, data.std))
        PosteriorDensity(case, undeclared, select_free(case, None))


def test_columns_of_a_discrepancy_have_its_covariance_by_channel_and_gear(case):
    own = Discrepancy(constant=0.3, slip_length=0.2, log_load_length=0.5)
    at = Operating(slip=SLIP, load=LOAD, gear=np.asarray(["a", "b", "a", "a"]))
    data = rows_of(case, at=at)
    process = discrepancy_process(data, {"torque_Nm": own}, Discrepancy(), 1e-6)
    assert not process.columns[data.channel == 1].any() and (process.channel == 0).all()
    torque = process.columns[data.channel == 0]
    assert process.usual.tolist() == [0.3, 0.0]
    points = np.stack([SLIP / 0.2, np.log(LOAD) / 0.5])
    far = ((points[:, :, None] - points[:, None, :]) ** 2).sum(axis=0)
    same = at.gear[:, None] == at.gear
    np.testing.assert_allclose(torque @ torque.T, 0.09 * np.exp(-0.5 * far) * same, atol=2e-4)
    joined = _stacked([torque, np.ones((3, 2))])
    assert joined.shape == (7, torque.shape[1] + 2)
    np.testing.assert_array_equal(joined[:4, :-2], torque)
    assert not joined[:4, -2:].any() and not joined[4:, :-2].any() and joined[4:, -2:].all()


def test_standard_deviations_of_a_table_stand_before_those_of_the_case(case):
    columns = {"slip": SLIP, "load_N": LOAD, "torque_Nm": np.asarray([1.0, 2.0, 3.0, 4.0])}
    given = Table(columns | {"torque_Nm_std": np.asarray([0.5, np.nan, 0.0, 0.7])})
    data = usable_readings(replace(case, noise={"torque_Nm": Noise(share=0.1)}), given)
    np.testing.assert_allclose(data.std, [0.5, 0.2, 0.5, 0.7])  # 0 by the median
    assert data.notes[0].text.endswith("standard deviation 0 replaced by the column's median 0.5")
    assert data.row_count == data.reading_count == 4 and data.squares_within == 0.0
    assert data.from_case.tolist() == [False, True, False, False]
    part = data.of_rows(np.asarray([0, 2]))[1]
    assert part.row_slip.tolist() == [0.1, 0.5] and part.measured.tolist() == [1.0, 3.0]
    zeros = Table(columns | {"torque_Nm_std": np.zeros(4)})
    with pytest.raises(FitError, match="row 1, column torque_Nm: standard deviation 0"):
        usable_readings(replace(case, noise={}), zeros)
