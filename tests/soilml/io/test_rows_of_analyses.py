"""Analyses take tables, data frames and mappings of columns, with one rule and one error."""

import numpy as np
import pytest

from soilml import Case, Model, Operating, Table, Wheel, identify, soil
from soilml.config.measurement_noise import Noise
from soilml.errors import TableError
from soilml.gap import audit, gap
from soilml.identification.bevameter import bevameter
from soilml.io.read_table import as_table
from soilml.numerics.prior import Prior
from soilml.traction import pull_report as pull

SLIP, LOAD = np.tile([0.1, 0.2, 0.35, 0.5], 3), np.repeat([40.0, 60.0, 90.0], 4)
CASE = Case(
    Model(Wheel(radius=0.15, width=0.12)),
    soil("wong1989/dry_sand"),
    {"cohesion": Prior(0.0, 3000.0), "friction_angle": Prior(0.3, 0.8)},
    {"torque_Nm": Noise(share=0.02)},
)
COLUMNS = {
    "run": np.repeat(["a", "b", "c"], 4),
    "slip": SLIP,
    "load_N": LOAD,
    "torque_Nm": CASE.model(CASE.soil, Operating(slip=SLIP, load=LOAD)).torque,
}
LISTS = {name: column.tolist() for name, column in COLUMNS.items()}


class Frame:
    """A data frame of a library that soilml does not know."""

    def __init__(self, columns):
        self.arrow = pytest.importorskip("pyarrow").table(columns)

    def __arrow_c_stream__(self, requested_schema=None):
        return self.arrow.__arrow_c_stream__(requested_schema)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("made", "answer"),
    [
        (Frame, lambda rows: identify(CASE, rows, method="nonlinear").values),
        (dict, lambda rows: gap(CASE, rows).as_json()["gap"]),
        (Frame, lambda rows: audit(CASE, rows, effects={}).as_json()),
        (dict, lambda rows: pull(CASE, rows, exact_model=True).by_load[0].posterior.pull),
    ],
    ids=["identify", "gap", "audit", "pull"],
)
def test_rows_of_any_kind_give_the_same_answer(made, answer):
    np.testing.assert_equal(answer(made(LISTS)), answer(Table(COLUMNS)))


def test_tests_of_a_soil_as_columns():
    z = np.linspace(0.005, 0.04, 8)
    plates = {"test": ["a"] * 8, "plate_radius_m": [0.05] * 8, "sinkage_m": z.tolist()}
    plates["pressure_Pa"] = (1e6 * z).tolist()
    arrays = Table({name: np.asarray(values) for name, values in plates.items()})
    assert bevameter(plates).soil == bevameter(arrays).soil


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ([[0.1, 60.0]], "rows are list; needed is a Table"),
        (None, "rows are NoneType"),
        ("no_runs.csv", "no_runs.csv: there is no such file"),
        ({"slip": [0.1, 0.2], "load_N": [60.0]}, "differ in length: slip has 2, load_N has 1"),
        ({"slip": [[0.1, 0.2]]}, r"column slip: has shape \(1, 2\)"),
        ({"slip": ["much"]}, "column slip: needed are numbers"),
        ({"slip": [{}]}, "column slip: needed are numbers"),
        ({"slip": ["0.1"]}, "column slip: needed are numbers"),
        ({"slip": ["1_0e-2", 0.1]}, "column slip: needed are numbers"),
        ({"slip": [True]}, "column slip: needed are numbers"),
        ({"slip": [[0.1], [0.1, 0.2]]}, "column slip: needed is one value a row"),
        ({"run": [None, "a"], "slip": [0.1, 0.2]}, "run"),
        ({"run": ["a\x1b[31m"], "slip": [0.1]}, "control characters"),
        ({"slip": [0.1], "load": [60.0]}, "the unit is missing, name it load_N"),
        ({"slip": [20.0], "load_N": [60.0]}, "a slip ratio, between -1 and 1"),
        ({"slip": [0.1, np.nan], "load_N": [60.0, 60.0]}, "slip"),
        ({}, "the table has a header but no row"),
    ],
)
def test_other_rows_are_refused_in_one_line(rows, said):
    with pytest.raises(TableError, match=said) as raised:
        as_table(rows)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"torque_Nm": np.full(12, np.inf)}, "column torque_Nm: inf given"),
        ({"torque_Nm": np.full(12, 1e300)}, "a torque between -1e7 and 1e7"),
        ({"torque_Nm": np.ones(3)}, "columns differ in length"),
        ({"torque_Nm": [1.0] * 11 + ["2"]}, "column torque_Nm: needed are numbers"),
        ({"torque_Nm": np.ones((12, 1))}, "one value a row"),
        ({"drawbarpull": np.ones(12)}, "column 'drawbarpull'"),
        ({5: np.ones(12)}, "a column is named 5"),
    ],
)
def test_a_table_that_no_file_held_is_checked_as_files_are(changes, said):
    rows = COLUMNS | changes
    for given in (Table(rows, "mine"), rows):
        with pytest.raises(TableError, match=said) as raised:
            as_table(given)
        assert "\n" not in str(raised.value)
    kept = as_table(Table(COLUMNS, "mine", metadata={"a": "b"}))
    assert (kept.source, kept.metadata) == ("mine", {"a": "b"})
