"""Progress of a campaign and direction of its loads, from the order of the rows."""

import numpy as np
import pytest

from soilml import EFFECTS, Case, Model, Wheel, simulate, soil
from soilml.fitting.levels import replicate_rows
from soilml.fitting.operating_points import operating_points
from soilml.fitting.row_order import campaign_progress, with_order_columns
from soilml.io.table import Table
from soilml.physics.operating_point import FROM_ORDER

SAND = soil("wong1989/dry_sand")
PLAIN = Case(Model(Wheel(radius=0.15, width=0.12)), SAND)
RNG = np.random.default_rng(5)


def rows(count=16, **more):
    """Rows of four runs at slips and loads in no order."""
    columns = {
        "run": np.repeat(["a", "b", "c", "d"], count // 4),
        "slip": RNG.permutation(np.linspace(0.1, 0.6, count)),
        "load_N": RNG.permutation(np.repeat([40.0, 60.0], count // 2)),
    }
    return Table(columns | more)


def test_progress_is_that_of_one_clock_else_that_of_the_rows():
    even = np.arange(16) / 15
    np.testing.assert_allclose(campaign_progress(rows()), even)
    time = np.ravel([start + np.linspace(0.0, 10.0, 4) for start in (0.0, 15.0, 130.0, 190.0)])
    np.testing.assert_allclose(campaign_progress(rows(time_s=time)), time / 200.0)
    anew = np.tile(np.linspace(0.0, 70.0, 4), 4)  # a clock that starts again with each run
    np.testing.assert_allclose(campaign_progress(rows(time_s=anew)), even)


def test_columns_are_added_for_effects_that_use_them_alone():
    table = rows()
    assert with_order_columns(PLAIN, table) is table
    drifting = Case(PLAIN.model + EFFECTS["cohesion-drift"](), SAND)
    assert set(with_order_columns(drifting, table).columns) - set(table.columns) == {"progress"}
    whole = with_order_columns(PLAIN, table, FROM_ORDER)
    assert set(whole.columns) - set(table.columns) == {"progress", "load_direction"}
    own = rows(progress=np.zeros(16))
    np.testing.assert_array_equal(with_order_columns(drifting, own)["progress"], 0.0)


SORTED = {
    "run": np.repeat(["a", "b", "c", "d"], 4),
    "slip": np.tile(np.linspace(0.1, 0.6, 4), 4),
    "load_N": np.repeat([40.0, 60.0, 90.0, 110.0], 4),
}


@pytest.mark.parametrize(
    ("columns", "ordered"),
    [
        ({}, True),
        (SORTED, False),
        (SORTED | {"time_s": np.arange(16.0)}, True),
        ({"run": np.repeat(["a", "b"], 8)}, False),  # two runs may differ for any reason
        ({"run": np.tile(["a", "b", "c", "d"], 4)}, False),
        ({"run": np.repeat(["a"], 16), "time_s": np.arange(16.0)}, True),
    ],
    ids=["mixed", "sorted", "sorted and timed", "two runs", "runs in turn", "one run, timed"],
)
def test_rows_have_an_order_unless_it_may_be_that_of_slip_load_or_run(columns, ordered):
    table = rows(**columns)
    added = with_order_columns(PLAIN, table, FROM_ORDER).columns.keys() - table.columns.keys()
    assert ("progress" in added) == ordered


def test_simulated_rows_say_that_the_campaign_is_over():
    case = Case(PLAIN.model + EFFECTS["load-hysteresis"](error=0.1), SAND)
    simulated = simulate(case, slip=[0.1, 0.3], load=[60.0, 40.0])
    assert simulated["load_direction"].tolist() == [0.0, 0.0]
    assert "progress" not in simulated
    np.testing.assert_array_equal(
        simulated["torque_Nm"], simulate(PLAIN, slip=[0.1, 0.3], load=[60.0, 40.0])["torque_Nm"]
    )


def test_rows_that_differ_in_their_order_alone_are_repeats():
    columns = {"run": ["a"] * 12, "slip": [0.1, 0.3, 0.5] * 4, "load_N": [60.0] * 12}
    columns = {name: np.asarray(values) for name, values in columns.items()}
    table = with_order_columns(PLAIN, Table(columns), FROM_ORDER)
    assert "progress" in table
    assert np.unique(replicate_rows(operating_points(table))).size == 3
