"""The reader of large CSV files gives what the reader of all others gives, faults included."""

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from soilml.errors import TableError
from soilml.io import csv_by_arrow, csv_file
from soilml.io.read_table import read_table

pytest.importorskip("pyarrow")
HEADER = "run,slip,load_N,torque_Nm"
NUMBERS = st.floats(0.001, 0.9).map(repr) | st.sampled_from(["0.1", ".5", "1e-3", "2.5E-1", "0.30"])
GOOD = st.sampled_from(["", " 0.25", "0.25 ", "12345678901234567890e-21", "0.1000000000000000055"])
ODD = st.sampled_from(["+0.1", "nan", "inf", "1e999", "1_0", "0x1", "1,5", "-", '"0.2"', '"0', " ",
                       "\t", "٣", "0.1d0"])  # fmt: skip
NAMES = st.sampled_from(["a", "b ", " b", "sand 2", "'=1+1", "'=", "é", "run-7", "a" * 40])
ODD_NAMES = st.sampled_from(["", '"a, b"', 'a"b', "\x1b", "a" * 300, "\x85", "\u2028"])


def both(folder, text, monkeypatch):
    """What both readers give: columns and lines, or the message of the fault."""
    file = folder / "runs.csv"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    found = []
    for smallest in (0, 1 << 60):
        monkeypatch.setattr(csv_by_arrow, "SMALLEST", smallest)
        try:
            table = read_table(file)
        except TableError as error:
            found.append(str(error))
        else:
            columns = {name: (v.dtype, v.tobytes()) for name, v in table.columns.items()}
            found.append((columns, table.line.tolist()))
    return found


@pytest.fixture(autouse=True)
def _small_blocks(monkeypatch):
    monkeypatch.setattr(csv_by_arrow, "BLOCK", 130)


@settings(max_examples=150, deadline=None)
@given(
    rows=st.lists(
        st.tuples(NAMES | ODD_NAMES, NUMBERS | ODD, NUMBERS, NUMBERS | GOOD | ODD).map(",".join)
        | st.sampled_from(["", ",,,", " ", "a,0.1", "a,0.1,1,1,1"]),
        max_size=4,
    ),
    end=st.sampled_from(["\n", "\r\n", "\r"]),
    last=st.booleans(),
    head=st.sampled_from([HEADER, f"\ufeff{HEADER}", f" {HEADER} ", f"\n{HEADER}", '"run",slip']),
)
@example(rows=["a,0.1,1,", "", "b,0.2,2,3"], end="\r\n", last=False, head=HEADER)
@example(rows=["a,0.1,1,\0"], end="\n", last=True, head=HEADER)
def test_any_text(tmp_path_factory, rows, end, last, head):
    with pytest.MonkeyPatch.context() as patch:
        folder = tmp_path_factory.mktemp("csv")
        fast, slow = both(folder, end.join([head, *rows]) + end * last, patch)
    assert fast == slow


@settings(max_examples=50, deadline=None)
@given(rows=st.lists(st.tuples(NAMES, NUMBERS, NUMBERS, NUMBERS | GOOD), min_size=1, max_size=8))
def test_good_files_are_not_read_twice(tmp_path_factory, rows):
    text = "\n".join([HEADER, *map(",".join, rows)]) + "\n"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(csv_file, "_columns", lambda *_: pytest.fail("read cell by cell"))
        patch.setattr(csv_by_arrow, "SMALLEST", 0)
        file = tmp_path_factory.mktemp("csv") / "runs.csv"
        file.write_text(text)
        table = read_table(file)
    assert table["slip"].tolist() == [float(row[1]) for row in rows]
    assert table.line.tolist() == list(range(2, len(rows) + 2))


def test_text_that_is_not_utf_8_and_endless_lines(tmp_path, monkeypatch):
    row = b"a,0.1,60,2.5\n"
    for text in (row + b"\xff,0.1,60,2.5\n", row * 9 + b"a,0.1,60," + b" " * 1_000_000 + b"1\n"):
        fast, slow = both(tmp_path, f"{HEADER}\n".encode() + text, monkeypatch)
        assert fast == slow and isinstance(fast, str)


def test_without_pyarrow_the_other_reader_reads(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "pyarrow", None)
    fast, slow = both(tmp_path, f"{HEADER}\na,0.1,60,2.5\n", monkeypatch)
    assert fast == slow and not isinstance(fast, str)


def test_progress_is_told_by_block(tmp_path, monkeypatch):
    monkeypatch.setattr(csv_by_arrow, "SMALLEST", 0)
    file, told = tmp_path / "runs.csv", []
    file.write_text(f"{HEADER}\n" + "a,0.1,60,2.5\n" * 40)
    assert len(read_table(file, progress=told.append)) == 40
    assert told == sorted(told) and told[-1] == file.stat().st_size and len(told) > 3
