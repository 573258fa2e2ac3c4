"""Names and numbers from files: plain text, decimal numbers in ASCII, no formulas."""

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from conftest import MODEL

from soilml.cli import main
from soilml.errors import TableError
from soilml.io.cell_text import escaped, is_plain, read_number, read_whole_number
from soilml.io.read_table import read_table

HOSTILE = ["\x1b[2J", "a\x07b", "\x9b31m", "a\u202eb", "a\u200bb", "\u2028"]
#: What Python's `float` takes beside decimal numbers, and texts that it does not take.
REFUSED = [
    *("1_000", "0_1", "\uff11\uff12", "\u0967", "\u0661", "nan", "inf", "-Infinity", "1e999"),
    *("0x10", "1,5", "", " ", "--1", "1e", "e5", "1 000", "\xbd"),
]  # fmt: skip


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


@pytest.mark.parametrize("text", REFUSED)
def test_what_is_no_decimal_number_is_refused(text):
    with pytest.raises(ValueError):
        read_number(text)
    with pytest.raises(ValueError):
        read_whole_number(text)


@pytest.mark.parametrize("text", ["1", "-0.5", "+3", ".5", "5.", "1e-3", "1E+3", "007"])
def test_decimal_numbers_are_read_as_python_does(text):
    assert read_number(text) == float(text)


@pytest.mark.parametrize("text", [text for text in REFUSED if text.strip() and "," not in text])
def test_cells_and_selections(text, tmp_path):
    file = tmp_path / "runs.csv"
    file.write_text(f"run,slip,load_N,torque_Nm\na,0.1,60,1\na,0.2,60,{text}\n")
    with pytest.raises(TableError, match="line 3, column torque_Nm"):
        read_table(file)
    file.write_text("run,slip,load_N,torque_Nm\na,0.1,60,1000\n")
    with pytest.raises(TableError, match="is not a number"):
        read_table(file).where("torque_Nm", text)


@pytest.mark.parametrize("text", ["1_0", "\uff11\uff12", "\u0967"])
def test_options(text, tmp_path, capsys):
    (tmp_path / "m.toml").write_text(MODEL)
    (tmp_path / "r.csv").write_text("run,slip,load_N,torque_Nm\na,0.1,60,1\n")
    model, runs = str(tmp_path / "m.toml"), str(tmp_path / "r.csv")
    for words in (
        ["simulate", model, "--slip", f"0.{text}", "--load", "60"],
        ["simulate", model, "--slip", f"0.1:0.2:{text}", "--load", "60"],
        ["simulate", model, "--slip", "0.1", "--load", "60", "--speed", text],
        ["gap", model, runs, "--out", str(tmp_path / "o"), "--checked", f"torque-offset={text}"],
        ["gap", model, runs, "--out", str(tmp_path / "o"), "--seed", text],
        ["plan", "next", model, "--count", text],
        ["generate", "wheel", str(tmp_path / "o.parquet"), "--rows", text],
        ["generate", "wheel", str(tmp_path / "o.parquet"), "--workers", text],
    ):
        status = main(words)
        assert status == 2, words
        assert capsys.readouterr().err.count("\n") == 1
