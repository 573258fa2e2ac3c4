"""Gear and pass of each row of a rover, from the name of its wheel."""

from dataclasses import replace

import numpy as np
import pytest
from gap_sets import case_of

from soilml.errors import TableError
from soilml.fitting.operating_points import with_rover_columns
from soilml.io.table import Table

# the first rear wheel overlaps the rut of the front wheel, 0.11 m beside it; the second is narrower
# by 0.03 m, and runs beside the rut
MODEL = """\
[gears.wide]
type = "wheel"
radius = 0.15
width = 0.12
[gears.narrow]
type = "wheel"
radius = 0.15
width = 0.09
[soil]
name = "wong1989/dry_sand"
[rover]
mass = 30
centre_of_mass = [0.0, 0.0, 0.3]
[rover.wheels]
front = { position = [0.4, 0.0], gear = "wide" }
first = { position = [-0.4, 0.11], gear = "wide" }
second = { position = [-0.4, -0.11], gear = "narrow" }
"""


@pytest.fixture
def case():
    return case_of(MODEL)


def rows(**columns):
    return Table({name: np.asarray(values) for name, values in columns.items()})


def test_gear_and_pass_of_each_row(case):
    table = rows(wheel=["second", "front", "first", "front"], slip=[0.1, 0.2, 0.3, 0.4])
    found = with_rover_columns(case, table)
    assert list(found["gear"]) == ["narrow", "wide", "wide", "wide"]
    assert list(found["pass"]) == [1.0, 1.0, 2.0, 1.0]
    assert "gear" not in table  # the table given is left as it was


def test_columns_that_are_given_stay(case):
    table = rows(wheel=["front", "first"], gear=["narrow", "narrow"])
    assert list(with_rover_columns(case, table)["gear"]) == ["narrow", "narrow"]
    table = rows(wheel=["front", "first"], **{"pass": [3.0, 4.0]})
    assert list(with_rover_columns(case, table)["pass"]) == [3.0, 4.0]


def test_nothing_changes_without_a_rover_or_without_wheels(case):
    table = rows(slip=[0.1, 0.2])
    assert with_rover_columns(case, table) is table
    table = rows(wheel=["nobody"])
    assert with_rover_columns(replace(case, rover=None), table) is table


def test_an_unknown_wheel_is_named_with_its_row(case):
    expected = r"row 3, column wheel: 'left'; wheels of \[rover\] are: front, first, second"
    with pytest.raises(TableError, match=expected):
        with_rover_columns(case, rows(wheel=["front", "first", "left", "right"]))
    with pytest.raises(TableError, match="row 2, column wheel: the cell is blank"):
        with_rover_columns(case, rows(wheel=["front", ""]))
