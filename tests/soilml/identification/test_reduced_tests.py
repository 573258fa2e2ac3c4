"""Plate and shear tests reduced to one pressure and one strength, and rows that are alike."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from channel_readings import channel_readings

from soilml import Operating
from soilml.identification import condensing, fit, posterior_sampling
from soilml.identification.bevameter import soil_section
from soilml.identification.bevameter.soil_section import pressure_test, strength_test
from soilml.numerics.importance_sampling import ImportanceSample


def spread(value, low, high):
    return SimpleNamespace(value=value, another_place_95=(low, high))


def plate_fit(sizes, pressure=None):
    """A fit of plates; `widths` are those that its pressure was asked for."""
    widths, pressure = [], pressure or spread(1e4, 8e3, 1.25e4)

    def pressure_at_depth(width):
        widths.append(width)
        return pressure

    return SimpleNamespace(
        several_sizes=len(set(sizes)) > 1,
        sizes=sizes,
        depth=0.04,
        pressure_at_depth=pressure_at_depth,
        widths=widths,
    )


@pytest.fixture
def widths(monkeypatch):
    """Sets the widths of a case's gears."""
    return lambda *found: monkeypatch.setattr(
        soil_section, "widths_of_gears", lambda case: list(found)
    )


def test_several_plates_give_the_pressure_under_the_width_of_the_one_gear(widths):
    fit = plate_fit([0.05, 0.1])
    widths(0.16)
    found = pressure_test(fit, None)
    assert (found.plate_width, found.sinkage, found.pressure) == (0.16, 0.04, 1e4)
    # half of the 95 % interval of the logarithm, over 1.96
    assert found.scatter == pytest.approx(math.log(1.25e4 / 8e3) / (2.0 * 1.96), abs=0.005)
    for several in ((), (0.1, 0.2)):  # else the harmonic mean of the plates
        widths(*several)
        assert pressure_test(fit, None).plate_width == pytest.approx(2.0 / 30.0, rel=1e-3)


@pytest.mark.parametrize("gear, found", [(0.1, True), (0.109, True), (0.111, False), (0.09, False)])
def test_plates_of_one_size_tell_nothing_of_a_gear_of_another_width(widths, gear, found):
    fit = plate_fit([0.1, 0.1])
    widths(gear)
    assert (pressure_test(fit, None) is not None) == found
    assert fit.widths == ([0.1] if found else [])


@pytest.mark.parametrize("ends", [(0.0, 2e4), (-1.0, 2e4), (1e4, 2e4), (8e3, 1e4)])
def test_a_range_that_does_not_contain_its_value_above_zero_is_no_test(widths, ends):
    widths(0.1)
    assert pressure_test(plate_fit([0.1], spread(1e4, *ends)), None) is None
    assert strength_test(SimpleNamespace(strength=spread(1e4, *ends), tests=[])) is None


def test_a_strength_is_that_under_the_mean_stress_and_no_two_places_are_alike():
    tests = [SimpleNamespace(normal_stress=stress) for stress in (1e3, 2e3, 6e3)]
    found = strength_test(SimpleNamespace(strength=spread(2e3, 1.99e3, 2.01e3), tests=tests))
    assert (found.normal_stress, found.strength, found.scatter) == (3e3, 2e3, 0.02)


def test_a_test_of_the_soil_is_remarked_on_from_two_and_a_half_sigma():
    assert fit.NOTABLE == 2.5


def test_rows_are_alike_by_slip_and_log_load_over_their_spreads_and_by_their_noise():
    slip, load = np.asarray([0.1, 0.3, 0.5, 0.2]), np.asarray([30.0, 60.0, 90.0, 120.0])
    std = np.asarray([0.1, np.nan, 0.3, 0.1])
    at = Operating(slip=slip, load=load, speed=np.full(4, 0.1))
    readings = channel_readings(at, {"torque": (np.where(np.isnan(std), np.nan, 1.0), std)})
    found = condensing._coordinates(readings, readings.std)
    logs = np.log([0.1, 0.3, 0.1])
    expected = [
        slip / slip.std(),
        np.log(load) / np.log(load).std(),  # the speed does not vary
        [logs[0], logs.mean(), logs[1], logs[2]],
    ]
    np.testing.assert_allclose(found.T, expected)


def test_samples_lie_within_the_priors():
    """A density that is flat, and that rises without end towards one end of a prior."""

    class Density:
        asked = np.zeros((0, 2))

        def __call__(self, u):
            self.asked = np.vstack([self.asked, u])
            return 40.0 * u[:, 1] - 8.0 * u[:, 0]

    density, rng = Density(), np.random.default_rng(0)
    near = rng.uniform([0.0, 0.8], [0.3, 1.0], (512, 2))
    start = ImportanceSample(near, np.full(512, 1.0 / 512), 0.0)
    found = posterior_sampling.of_model(density, start, 1.0, 8)
    for points in (found.u, density.asked):
        assert len(points) > 1000 and (points > 0.0).all() and (points < 1.0).all()
    mean = found.weights @ found.u
    # of exponential distributions with the rates 8 and 40, cut at the other end of the prior
    assert mean == pytest.approx([1.0 / 8.0 - 1.0 / np.expm1(8.0), 1.0 - 1.0 / 40.0], abs=0.012)
