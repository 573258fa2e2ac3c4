"""Progress of a campaign and direction of its loads, from the order of the rows."""

import numpy as np

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


def test_sorted_rows_have_no_progress_unless_they_were_timed():
    slip, load = np.tile(np.linspace(0.1, 0.6, 8), 3), np.repeat([40.0, 60.0, 90.0], 8)
    columns = {"run": np.repeat(["a", "b", "c"], 8), "slip": slip, "load_N": load}
    assert "progress" not in with_order_columns(PLAIN, Table(columns), FROM_ORDER)
    timed = Table(columns | {"time_s": np.arange(24.0)})
    assert "progress" in with_order_columns(PLAIN, timed, FROM_ORDER)


def test_two_runs_that_differ_may_do_so_for_any_reason():
    two = rows(run=np.repeat(["a", "b"], 8))
    assert "progress" not in with_order_columns(PLAIN, two, FROM_ORDER)


def test_rows_of_runs_that_alternate_have_no_order_unless_they_were_timed():
    mixed = np.tile(["a", "b", "c", "d"], 4)
    assert (
        with_order_columns(PLAIN, rows(run=mixed), FROM_ORDER).columns.keys()
        == rows().columns.keys()
    )
    timed = with_order_columns(
        PLAIN, rows(run=np.repeat(["a"], 16), time_s=np.arange(16.0)), FROM_ORDER
    )
    assert {"progress", "load_direction"} <= timed.columns.keys()


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
