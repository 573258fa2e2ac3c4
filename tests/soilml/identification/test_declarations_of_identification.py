"""What the room declares: frozen values, and sizes of usual errors as the pages state them."""

import inspect
import re
from dataclasses import FrozenInstanceError, is_dataclass
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages

import numpy as np
import pytest

import soilml.identification
from soilml.fitting import levels
from soilml.fitting.shared_errors import (
    PULL_OFFSET_SHARE,
    USUAL_MODEL_ERRORS,
    USUAL_SENSOR_ERRORS,
    ModelledErrors,
)
from soilml.identification.linear import SIDES
from soilml.identification.posterior import INTERVAL
from soilml.identification.trained_estimator import FIXED_ANGLE
from soilml.physics.soils import Soil

PAGE = (Path(__file__).parents[3] / "docs" / "concepts" / "sets.md").read_text()
CLASSES = [
    cls
    for module in walk_packages(soilml.identification.__path__, "soilml.identification.")
    for _, cls in inspect.getmembers(import_module(module.name), is_dataclass)
    if inspect.isclass(cls) and cls.__module__ == module.name
]


@pytest.mark.parametrize("cls", CLASSES, ids=lambda cls: f"{cls.__module__}.{cls.__name__}")
def test_values_are_frozen(cls):
    blank = object.__new__(cls)
    with pytest.raises(FrozenInstanceError):
        blank.anything = 1.0


def stated(row, column, part=0):
    """A number in a column of the row of a table that begins with this text."""
    line = next(line for line in PAGE.splitlines() if line.startswith(f"| {row}"))
    return float(re.search(r"[\d.]+", line.split("|")[column].split(";")[part]).group())


@pytest.mark.parametrize(
    ("name", "row"),
    {
        "slip_bias": "offset of slip",
        "load_gain": "relative error of load",
        "torque_gain": "relative error of torque",
        "sinkage_bias": "offset of sinkage",
    }.items(),
)
def test_usual_errors_of_sensors_are_those_of_the_page(name, row):
    assert USUAL_SENSOR_ERRORS[name] == stated(row, 3)
    assert pytest.approx(0.01 * stated("offset of pull", 3)) == PULL_OFFSET_SHARE


@pytest.mark.parametrize(
    ("name", "row", "part", "unit"),
    [
        ("bearing", "logarithm of the bearing modulus", 0, 1.0),
        ("bearing_by_slip", "logarithm of the bearing modulus", 1, 1.0),
        ("bearing_by_load", "logarithm of the bearing modulus", 2, 1.0),
        ("sinkage", "sinkage; drawbar pull", 0, 0.01),
        ("drawbar_pull", "sinkage; drawbar pull", 1, 0.01),
    ],
)
def test_usual_errors_of_the_model_are_those_of_the_page(name, row, part, unit):
    assert USUAL_MODEL_ERRORS[name] == pytest.approx(unit * stated(row, 2, part))
    assert USUAL_MODEL_ERRORS["contact"] == 1.0


def test_an_error_is_zero_unless_it_is_given():
    error = ModelledErrors()
    for name in ("slip_bias", "load_gain", *USUAL_MODEL_ERRORS):
        assert getattr(error, name, 0.0) == 0.0
    assert error.typical_load == 1.0


def test_files_for_any_wheel_have_the_usual_angle_of_maximum_stress():
    assert {name: getattr(Soil, name) for name in ("a0", "a1")} == FIXED_ANGLE


def test_sides_of_a_uniform_prior_are_one_standard_deviation_off_its_middle():
    deviation = np.std(np.linspace(0.0, 1.0, 100_001))
    np.testing.assert_allclose(SIDES, [0.5 - deviation, 0.5 + deviation], rtol=1e-4)
    assert INTERVAL[1] - INTERVAL[0] == pytest.approx(0.9)
    assert INTERVAL.sum() == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("field", "together", "apart"),
    [
        ("pass_number", [1.0, 1.4], [1.0, 1.6]),
        ("slip_angle", [0.1, 0.115], [0.1, 0.125]),
        ("speed", [0.1, 0.11], [0.1, 0.115]),
    ],
)
def test_gaps_that_divide_levels_of_covariates(field, together, apart):
    assert levels.covariate_levels(field, np.asarray(together)).count == 1
    assert levels.covariate_levels(field, np.asarray(apart)).count == 2


def test_noise_widens_every_figure_of_a_rule():
    rule = levels.LevelRule(gap=0.1, fine_gap=0.02, scatter=0.03, step=0.2)
    assert rule.with_noise(0.0) == rule
    assert rule.with_noise(0.01) == levels.LevelRule(0.1, 0.04, 0.03, 0.2)
    assert rule.with_noise(0.05) == levels.LevelRule(0.2, 0.2, 0.05, 0.4)


def test_values_of_one_group_differ_by_no_more_than_its_width():
    values = np.asarray([0.30, 0.10, 0.11, 0.12, 0.131, 0.29])
    one = levels.Levels(np.asarray([1, 0, 0, 0, 0, 1]), np.zeros(2), np.zeros(2))
    assert levels._narrow_groups(values, one, 0.02).tolist() == [2, 0, 0, 0, 1, 2]
    apart = levels.Levels(np.asarray([1, 0, 0, 1, 1, 1]), np.zeros(2), np.zeros(2))
    assert levels._narrow_groups(values, apart, 0.5).tolist() == [1, 0, 0, 1, 1, 1]


def test_a_range_without_gaps_is_divided_into_equal_widths():
    rule = levels.LevelRule(gap=1.0, fine_gap=1.0, scatter=0.05, step=0.25)
    pairs = np.stack([np.linspace(0.0, 1.0, 41), np.arange(41.0)])
    parts = levels._divide_range(pairs, rule)
    assert [part[0, 0] for part in parts] == pytest.approx([0.0, 0.2, 0.4, 0.6, 0.8], abs=0.03)
    narrow = pairs * np.asarray([[0.1], [1.0]])
    assert len(levels._divide_range(narrow, rule)) == 1
    assert len(levels._divide_range(pairs[:, :1], rule)) == 1
