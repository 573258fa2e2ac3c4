"""Names from files neither steer a terminal nor become formulas of a spreadsheet."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from soilml.cli.process import fail
from soilml.errors import TableError
from soilml.io.plain_text import cell_as_text, escaped, is_plain, text_as_cell
from soilml.io.read_table import read_table
from soilml.io.text_tables import csv_text

HOSTILE = ["\x1b[2J", "a\x07b", "\x9b31m", "a\u202eb", "a\u200bb", "\u2028"]
FORMULAS = ["=1+1", "+cmd|' /C calc'!A0", "-2+3", "@SUM(A1)"]


@pytest.mark.parametrize("name", HOSTILE)
def test_names_with_control_characters_are_refused(name, tmp_path):
    name = f"a{name}b"
    assert not is_plain(name) and is_plain(escaped(name))
    file = tmp_path / "runs.csv"
    file.write_text(f"run,slip,load_N\nsand,0.1,60\n{name},0.1,60\n", encoding="utf-8", newline="")
    with pytest.raises(TableError, match=r"(line 3, column run: .* control characters)|line 3: 1"):
        read_table(file)
    columns = {"run": [name], "slip": [0.1], "load_N": [60.0]}
    pq.write_table(pa.table(columns), tmp_path / "runs.parquet")
    with pytest.raises(TableError, match=r"line 1, column run: .* control characters"):
        read_table(tmp_path / "runs.parquet")


def test_long_names_are_refused(tmp_path):
    """Every row of a column takes the memory of the longest name."""
    (tmp_path / "runs.csv").write_text(f"run,slip,load_N\n{'a' * 300},0.1,60\n")
    with pytest.raises(TableError, match="300 characters"):
        read_table(tmp_path / "runs.csv")


def test_an_error_is_printed_without_terminal_commands(capsys):
    fail("no column \x1b]0;title\x07 here", 2)
    assert capsys.readouterr().err == "soilml: no column \\x1b]0;title\\x07 here\n"


def test_names_of_all_languages_are_plain():
    for name in ("Größe 3", "砂地_1", "गीली रेत", "песок"):
        assert is_plain(name) and escaped(name) == name and text_as_cell(name) == name


@pytest.mark.parametrize("name", FORMULAS)
def test_no_cell_that_is_written_is_a_formula_and_it_is_read_back(name, tmp_path):
    text = csv_text({"run": [name], "slip": np.asarray([-0.1]), "load_N": np.asarray([60.0])})
    (tmp_path / "runs.csv").write_text(text)
    cell = text.splitlines()[1].removeprefix('"')
    assert cell.startswith("'") and ",-0.1,60" in text
    assert read_table(tmp_path / "runs.csv")["run"][0] == name
    assert cell_as_text("'quoted'") == "'quoted'"
