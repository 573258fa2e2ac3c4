"""Small files that ask for much are refused in one line, before they are read."""

import re
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

import small_files as files

ROOT = Path(__file__).parents[2]
IMPORT, ESTIMATE = ("import", "--init"), ("estimate", ROOT / "exported" / "wheel.onnx")
CASES = [
    ("packed.mat", files.packed_mat, IMPORT, "more than 40000000 values"),
    ("cells.mat", files.cells_mat, IMPORT, "more than 200000 arrays"),
    ("claimed.mat", files.claimed_mat, IMPORT, "more than 40000000 values"),
    ("nested.mat", files.nested_mat, IMPORT, "more than 32 structs in one another"),
    ("unallocated.h5", files.unallocated_hdf5, IMPORT, "more than 40000000 values"),
    ("far.xlsx", files.far_cell_xlsx, IMPORT, "more than 2000000 cells from A1"),
    ("implied.xlsx", files.implied_cells_xlsx, IMPORT, "more than 2000000 cells from A1"),
    ("text.xlsx", files.long_text_xlsx, IMPORT, "more than 536870912 bytes of text"),
    ("names.parquet", files.long_names_parquet, ESTIMATE, "bytes of text"),
    ("texts.parquet", files.large_dictionary_parquet, ESTIMATE, "bytes of text"),
    ("rows.parquet", files.constant_parquet, ESTIMATE, "more than 2000000 rows to estimate"),
    ("wide.csv", lambda: files.many_columns_csv(200_000), IMPORT, "more than 2000 columns"),
    ("header.csv", lambda: files.many_columns_csv(100_000), ESTIMATE, "more than 2000 columns"),
    ("wide.jsonl", files.widening_json, IMPORT, "more than 2000 columns"),
    ("chunk.mcap", files.claimed_chunk_mcap, IMPORT, "bytes in a compressed block"),
    ("chunk.bag", files.claimed_chunk_bag, IMPORT, "bytes in a compressed block"),
]  # fmt: skip
#: Files that take long to make, of which a quick test has another of the same refusal.
LONG = ("texts.parquet", "cells.mat", "implied.xlsx", "header.csv")
#: Peak of a process that refuses, bytes: libraries take a fifth of it, and the rows of a table
#: that may be read the rest.
MOST = 1 << 30


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "make", "words", "said"),
    [pytest.param(*c, id=c[0], marks=[pytest.mark.long] * (c[0] in LONG)) for c in CASES],
)
def test_a_small_file_that_asks_for_much_is_refused_in_one_line(tmp_path, name, make, words, said):
    (tmp_path / name).write_bytes(make())
    assert (tmp_path / name).stat().st_size < 10_000_000
    status, said_by_it, peak = files.run([*words, name], tmp_path)
    # progress of a file that takes more than two seconds, as on a busy machine, is no refusal
    progress = re.compile(r"reading .*( \.\.\.|: \d+ %.*)\n")
    error = "".join(x for x in said_by_it.splitlines(True) if not progress.fullmatch(x))
    assert (status, error.count("\n")) == (2, 1) and said in error and len(error) < 2000, error
    assert peak < MOST


def test_no_data_of_other_files_come_with_an_hdf5_file(tmp_path):
    h5py = pytest.importorskip("h5py")
    from soilml.errors import InputError
    from soilml.log_import.readers import read_log

    (tmp_path / "secret").write_bytes(bytes(range(64)))
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file.create_dataset("x", (64,), "u1", data=list(range(64)))
    with h5py.File(tmp_path / "external.h5", "w") as file:
        file.create_dataset("x", (64,), "u1", external=[(str(tmp_path / "secret"), 0, 64)])
    with h5py.File(tmp_path / "virtual.h5", "w") as file:
        layout = h5py.VirtualLayout((64,), "u1")
        layout[:] = h5py.VirtualSource(str(tmp_path / "other.h5"), "x", (64,))
        file.create_virtual_dataset("x", layout)
    for name in ("external.h5", "virtual.h5"):
        with pytest.raises(InputError, match="x is in another file"):
            read_log(tmp_path / name)
    with h5py.File(tmp_path / "link.h5", "w") as file:
        file["x"] = h5py.ExternalLink("other.h5", "/x")
        file["y"] = list(range(64))
    assert list(read_log(tmp_path / "link.h5")[0].columns) == ["y"]


def test_messages_have_a_bounded_length(capsys):
    from soilml.cli import main
    from soilml.errors import MOST_SHOWN, InputError

    assert main(["simulate", "m.toml", "--slip", "x" * 10**6, "--load", "60"]) == 2
    assert main(["estimate", "w.onnx", "--" + "y" * 10**6]) == 2
    said = capsys.readouterr().err.splitlines()
    assert [len(line) <= MOST_SHOWN + len("soilml estimate: ") for line in said] == [True, True]
    assert str(InputError("column " + "z" * 10**6 + "; needed is a name")).endswith("is a name")
