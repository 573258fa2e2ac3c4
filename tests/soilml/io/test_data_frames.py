"""Data frames in and out, by the Arrow interface that pandas, polars and pyarrow share."""

import numpy as np
import pyarrow as pa
import pytest
from test_rows_of_analyses import Frame

from soilml import identify, read_case, read_table
from soilml.errors import TableError

COLUMNS = {
    "run": ["a", "a", "b"],
    "slip": [0.1, 0.2, 0.3],
    "load_N": [40, 80, 40],
    "torque_Nm": [1.513, 4.826, None],
}


#: As polars exports text.
VIEWS = COLUMNS | {"run": pa.array(COLUMNS["run"], pa.string_view())}


@pytest.mark.slow
@pytest.mark.parametrize("frame", [pa.table(COLUMNS), Frame(COLUMNS), Frame(VIEWS)])
def test_a_frame_is_read_as_the_file_would_be(frame, model_file):
    table = read_table(frame, need=("run", "slip"))
    assert table["run"].tolist() == ["a", "a", "b"]
    assert table["load_N"].dtype == np.float64 and np.isnan(table["torque_Nm"][2])
    identify(read_case(model_file), table.rows(np.asarray([0, 1])), method="nonlinear")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"slip": [10.0, 20.0, 30.0]}, "row 1, column slip: 10 given; needed is a slip ratio"),
        ({"slipp": [0.1, 0.2, 0.3]}, "data frame: column 'slipp': did you mean 'slip'"),
        ({"load_N": ["40", "80", "40"]}, "column load_N: has type string; needed are numbers"),
        ({"slip": [None, 0.2, 0.3]}, "row 1, column slip: the cell is blank"),
    ],
)
def test_a_frame_is_checked_as_a_file_is(change, said):
    with pytest.raises(TableError, match=said):
        read_table(Frame(COLUMNS | change))


def test_a_selection_of_a_frame_of_pandas_and_its_file_are_read_without_their_index(tmp_path):
    pd = pytest.importorskip("pandas")
    frame = pd.DataFrame(COLUMNS).iloc[[0, 2]].set_index(pd.Index([7, 7]))
    frame.to_parquet(tmp_path / "runs.parquet")
    for rows in (frame, tmp_path / "runs.parquet"):
        assert read_table(rows)["slip"].tolist() == [0.1, 0.3]
    with pytest.raises(TableError, match="Duplicate column names"):
        read_table(pd.concat([frame, frame[["slip"]]], axis=1))
