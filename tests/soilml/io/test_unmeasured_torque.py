"""Tables of pulls or of sinkages alone need no empty column of torques."""

import numpy as np
import pytest

from soilml.errors import TableError
from soilml.io.read_table import RUNS, read_table


@pytest.mark.parametrize("other", ["drawbar_pull_N", "sinkage_m"])
def test_a_table_without_torque_has_none_in_any_row(other, tmp_path):
    file = tmp_path / "runs.csv"
    file.write_text(f"run,slip,load_N,{other}\na,0.1,60,0.5\na,0.2,60,0.7\n")
    table = read_table(file, RUNS)
    assert np.isnan(table["torque_Nm"]).all() and table[other][1] == 0.7


def test_a_table_that_measured_nothing_is_refused(tmp_path):
    file = tmp_path / "runs.csv"
    file.write_text("run,slip,load_N\na,0.1,60\n")
    with pytest.raises(TableError, match="torque_Nm is missing; needed is a torque, a drawbar"):
        read_table(file, RUNS)
