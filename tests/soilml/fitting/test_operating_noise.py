"""Noise of slip and load in the gap analysis."""

import numpy as np
import pytest
from gap_sets import MODEL, case_of, driven

from soilml.fitting.covariance import noise_of_operation
from soilml.fitting.readings import stack_readings
from soilml.gap import gap
from soilml.io.table import Table
from soilml.physics.operating_point import Operating
from soilml.remarks import texts

NOISY = MODEL.replace('torque_Nm = "1 %"', 'torque_Nm = "1 %"\nslip = 0.015\nload_N = "2 %"')


def test_noise_is_the_slope_times_that_of_slip_and_load():
    case = case_of(NOISY)
    readings = stack_readings(case, driven(case, loads=(50.0, 50.0, 50.0)))
    found = noise_of_operation(case, readings)
    slip, load = np.asarray(readings.at.slip), np.asarray(readings.at.load)

    def at(s, w):
        force = case.model(case.soil, Operating(slip=s, load=w))
        values = [np.asarray(getattr(force, name)) for name in readings.channels]
        return np.asarray(values)[readings.channel, readings.row]

    by_slip = (at(slip + 1e-4, load) - at(slip - 1e-4, load)) / 2e-4 * 0.015
    by_load = (at(slip, load + 0.01) - at(slip, load - 0.01)) / 0.02 * (0.02 * 50.0)
    assert found == pytest.approx(np.hypot(by_slip, by_load), rel=0.02)


def test_a_row_that_nothing_carries_beside_it_counts_as_exact():
    case = case_of(MODEL.replace('torque_Nm = "1 %"', 'torque_Nm = "1 %"\nload_N = 30.0'))
    readings = stack_readings(case, driven(case, loads=(50.0, 70.0, 90.0)))
    heavy = case.with_values({"kc": 1.0, "kphi": 2000.0})
    assert np.isfinite(noise_of_operation(heavy, readings)).all()


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_declared_noise_of_slip_is_no_gap(seed):
    case = case_of(MODEL.replace('torque_Nm = "1 %"', 'torque_Nm = "1 %"\nslip = 0.015'))
    table = driven(case, seed=seed)
    rng = np.random.default_rng(seed + 100)
    slip = np.maximum(table["slip"] + 0.015 * rng.standard_normal(len(table)), 0.01)
    report = gap(case, Table(table.columns | {"slip": slip}))
    assert report.status == "no-gap"
    assert not any("noise of" in note for note in texts(report.notes))
