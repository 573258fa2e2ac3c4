"""Figures of a verdict and checks of its data on numbers that are worked out by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from soilml import Operating
from soilml.fitting.readings import Readings
from soilml.gap import checks
from soilml.gap.run_options import (
    HIGHEST_SLIP,
    ROWS_PER_RUN,
    drivable_slips,
)
from soilml.remarks import texts


def stub(**values):
    return SimpleNamespace(**values)


@pytest.mark.parametrize(
    ("values", "std", "expected"),
    [
        ([1.0, 2.0, 3.0, 4.0], 4e-6, ["noise-too-small"]),
        ([1.0, 2.0, 3.0, 4.0], 4.1e-6, []),
        ([1.0, 2.0, 3.0, 4.0], np.nan, ["noise-undeclared"]),
        ([1.0, 1.0, 1.0, 1.0], 0.1, ["constant-channel"]),
        ([1.0, 1.0, 1.0], 0.1, []),  # few rows may agree
    ],
)
def test_noise_and_life_of_a_channel(values, std, expected):
    at = Operating(slip=np.linspace(0.1, 0.5, len(values)), load=np.full(len(values), 60.0))
    given = Readings.of_every_row(
        at,
        ("torque",),
        np.asarray(values),
        np.full(len(values), std),
        run=np.zeros(len(values), int),
    )
    found = [remark.code for remark in checks.faults_of(given, parameters=-1)]
    assert found == expected


@pytest.mark.parametrize(
    ("count", "fault", "obstacle"), [(6, True, True), (7, False, True), (11, False, False)]
)
def test_readings_for_three_parameters(count, fault, obstacle):
    at = Operating(slip=np.linspace(0.1, 0.5, count), load=np.linspace(40.0, 90.0, count))
    given = Readings.of_every_row(at, ("torque",), np.arange(1.0, count + 1.0), np.ones(count))
    assert [r.code for r in checks.faults_of(given, 3)] == ["few-readings"] * fault
    codes = {r.code for r in checks.naming_obstacles(given, 3)}
    assert codes == {"one-run"} | ({"few-readings"} if obstacle else set())


def test_repeats_give_the_noise_by_their_degrees_of_freedom():
    """Two groups of four: deviations of 1 and 2 about their means, six degrees of freedom."""
    values = [9.0, 11.0, 9.0, 11.0, 18.0, 22.0, 18.0, 22.0]
    given = stub(
        channels=("torque",), channel=np.zeros(8, dtype=int), measured=np.asarray(values),
        std=np.full(8, np.nan), replicates=np.repeat([3, 7], 4),
    )  # fmt: skip
    noise, notes = checks.estimate_repeat_noise(given)
    assert noise == {"torque": pytest.approx(np.sqrt(20.0 / 6.0))}
    assert texts(notes) == [
        "noise of torque_Nm is not declared: 1.83 was estimated from repeated rows"
    ]  # fmt: skip
    few = stub(**vars(given) | {"replicates": np.asarray([3, 3, 3, 3, 7, 7, 7, 8])})
    assert checks.estimate_repeat_noise(few) == ({}, [])
    equal = stub(**vars(given) | {"measured": np.repeat([9.0, 18.0], 4)})
    noise, notes = checks.estimate_repeat_noise(equal)
    assert noise == {} and "its repeated rows are equal" in notes[0].text
    known = stub(**vars(given) | {"std": np.ones(8)})
    assert checks.estimate_repeat_noise(known) == ({}, [])


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (0.05, 0.6, [0.05, 0.15, 0.2, 0.3, 0.35, 0.45, 0.5, 0.6]),
        (0.1, 0.2, [0.1, 0.11, 0.13, 0.14, 0.16, 0.17, 0.19, 0.2]),
        (0.1, 0.4, [0.1, 0.14, 0.19, 0.23, 0.27, 0.31, 0.36, 0.4]),  # seven in steps of 0.05
        (0.78, 0.95, [0.78, 0.79, 0.8]),
        (-0.95, -0.78, [-0.8, -0.79, -0.78]),
    ],
)
def test_slips_in_steps_that_a_rig_can_set(low, high, expected):
    found = drivable_slips(low, high)
    assert found.tolist() == expected
    assert found.size <= ROWS_PER_RUN and np.abs(found).max() <= HIGHEST_SLIP
