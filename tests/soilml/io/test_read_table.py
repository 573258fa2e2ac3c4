"""Tables: what is read, and what is said of faults."""

import numpy as np
import pytest

from soilml import read_table
from soilml.errors import TableError
from soilml.io.read_table import RUNS
from soilml.log_import.checks.table_hints import table_remarks

GOOD = "run,slip,load_N,torque_Nm,sinkage_m\na,0.1,60,1.5,0.012\na,0.2,60,,0.013\nb,0.3,80,2.5,\n"


def written(tmp_path, text, name="runs.csv"):
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def test_reads_numbers_names_and_blanks(tmp_path):
    table = read_table(written(tmp_path, GOOD), RUNS)
    assert len(table) == 3
    assert table["run"].tolist() == ["a", "a", "b"]
    assert np.isnan(table["torque_Nm"]).tolist() == [False, True, False]
    assert [name for name, _ in table.groups("run")] == ["a", "b"]
    assert len(table.where("run", "a")) == 2
    assert len(table.where("load_N", "80")) == 1
    assert table.place(2).endswith("line 4")


def test_a_byte_order_mark_spaces_and_empty_lines_do_no_harm(tmp_path):
    text = "\ufeff" + GOOD.replace(",", " , ").replace("\nb", "\n\nb")
    assert len(read_table(written(tmp_path, text), RUNS)) == 3


FAULTS = {
    "missing column": (
        "run,slip,load_N\na,0.1,60\n",
        "torque_Nm is missing; needed is a torque, a drawbar",
    ),
    "misspelt column": (GOOD.replace("torque_Nm", "torqe_Nm"), "did you mean 'torque_Nm'"),
    "wrong case": (GOOD.replace("torque_Nm", "Torque_nm"), "did you mean 'torque_Nm'"),
    "unit missing": (GOOD.replace("torque_Nm", "torque"), "name it torque_Nm"),
    "wrong unit": (GOOD.replace("load_N", "load_kN"), "load is read in N"),
    "wrong unit of length": (GOOD.replace("sinkage_m", "sinkage_mm"), "sinkage is read in m"),
    "extra column": (GOOD.replace("sinkage_m", "weather"), "'weather' is not known"),
    "column twice": (GOOD.replace("sinkage_m", "slip"), "slip occurs twice"),
    "text in a number": (GOOD.replace("0.013", "deep"), "line 3, column sinkage_m: 'deep'"),
    "NaN": (GOOD.replace("0.013", "nan"), "line 3, column sinkage_m: 'nan'"),
    "infinity": (GOOD.replace("2.5", "inf"), "line 4, column torque_Nm: 'inf'"),
    "slip above one": (GOOD.replace("0.3,80", "1.1,80"), "line 4, column slip: 1.1 given"),
    "slip in percent": (GOOD.replace("0.3,80", "30,80"), "line 4, column slip: 30 given"),
    "slip blank": (GOOD.replace("0.3,80", ",80"), "line 4, column slip: the cell is blank"),
    "negative load": (GOOD.replace("0.3,80", "0.3,-80"), "line 4, column load_N: -80 given"),
    "run blank": (GOOD.replace("b,", ","), "line 4, column run: the cell is blank"),
    "cells missing": (GOOD.replace("a,0.2,60,", "a,0.2,"), "line 3: 4 cells; needed are 5"),
    "semicolons": (GOOD.replace(",", ";"), "separator must be a comma"),
    "quote not closed": (GOOD.replace("a,0.2", '"a,0.2'), "line 4: "),
    "two stray quotes": (GOOD.replace("a,", '"a,').replace("b,", 'b",'), "quotation marks must"),
    "cell of two lines": (GOOD.replace("a,0.2", '"a\nb",0.2'), "a cell has several lines"),
    "endless cell": (GOOD.replace("0.013", "x" * 9000), f"'{'x' * 60}...' is not a number"),
    "long name": (GOOD.replace("\na,", f"\n{'a' * 300},"), "300 characters"),
    "no rows": (GOOD.splitlines()[0] + "\n", "no row"),
    "empty file": ("", "is empty"),
    "binary": (b"PK\x03\x04\x00\x00", "binary"),
    "latin text": ("run,slip\n\xe4".encode("latin-1"), "cannot be read as text"),
    "std of zero": (
        "run,slip,load_N,torque_Nm,torque_Nm_std\na,0.1,60,1.5,0\n",
        "standard deviation above zero",
    ),
}


@pytest.mark.parametrize("what", FAULTS)
def test_faults_are_named_by_file_line_and_column(tmp_path, what):
    text, said = FAULTS[what]
    with pytest.raises(TableError) as caught:
        read_table(written(tmp_path, text), RUNS)
    assert said in str(caught.value)
    assert "runs.csv" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_table_without_a_column_of_runs_is_one_run_and_says_so(tmp_path):
    text = "slip,load_N,torque_Nm\n0.1,60,1.5\n0.2,60,2.5\n"
    table = read_table(written(tmp_path, text), RUNS)
    assert set(table["run"].tolist()) == {"all rows"}
    assert [r.code for r in table_remarks(table, None, 0.15)] == ["no-runs"]


def test_extra_columns_can_be_passed_over(tmp_path):
    path = written(tmp_path, GOOD.replace("sinkage_m", "weather"))
    table = read_table(path, RUNS, ignore_extra=True)
    assert "weather" not in table


def test_a_table_with_names_of_another_laboratory_is_told_all_at_once(tmp_path):
    (tmp_path / "bin.csv").write_text("Test No,Slip (%),Load (N),Torque (Nm)\n1,5,50,1.5\n")
    with pytest.raises(TableError, match=r"none of its columns is known: 'Test No', .*torque_Nm'"):
        read_table(tmp_path / "bin.csv")
    (tmp_path / "box.csv").write_text("test,normal_kPa\na,4\n")
    with pytest.raises(TableError, match="normal_stress_Pa"):
        read_table(tmp_path / "box.csv")


def test_a_quote_that_is_not_closed_in_a_column_that_is_passed_over_loses_no_rows(tmp_path):
    lines = [f"{line},{note}" for line, note in zip(GOOD.splitlines(), "noxyz", strict=False)]
    text = "\n".join(lines).replace(",o", ',"o (open') + "\n"
    with pytest.raises(TableError, match="quotation marks must stand in pairs"):
        read_table(written(tmp_path, text), RUNS, ignore_extra=True)


def test_a_wheel_that_spins_on_the_spot_or_is_locked_is_read(tmp_path):
    file = written(tmp_path, "run,slip,load_N,torque_Nm\na,1,60,5\na,-1,60,-4\na,0.3,60,3\n")
    assert read_table(file)["slip"].tolist() == [0.9999, -0.9999, 0.3]


@pytest.mark.parametrize("other", ["drawbar_pull_N", "sinkage_m"])
def test_a_table_without_torque_has_none_in_any_row(other, tmp_path):
    file = written(tmp_path, f"run,slip,load_N,{other}\na,0.1,60,0.5\na,0.2,60,0.7\n")
    table = read_table(file, RUNS)
    assert np.isnan(table["torque_Nm"]).all() and table[other][1] == 0.7
