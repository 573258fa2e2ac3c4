"""Parquet files are held to what CSV files are held to."""

import datetime

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from soilml import read_table
from soilml.errors import TableError
from soilml.io.read_table import RUNS

GOOD = {"run": ["a", "a"], "slip": [0.1, 0.2], "load_N": [60, 60], "torque_Nm": [1.5, None]}


def written(folder, metadata=None, **columns):
    path = folder / "runs.parquet"
    table = pa.table(GOOD | columns)
    pq.write_table(table.replace_schema_metadata(metadata), path, write_page_checksum=True)
    return path


def test_reads_numbers_names_and_blanks(tmp_path):
    for run in (["a ", "b"], [1, 2], pa.array(["a", "b"]).dictionary_encode()):
        table = read_table(written(tmp_path, run=run), RUNS)
        assert table["run"].tolist() in (["a", "b"], ["1", "2"])
        assert np.isnan(table["torque_Nm"]).tolist() == [False, True]
        assert table["load_N"].dtype == np.float64
    nothing = pa.array([None, None])
    assert np.isnan(read_table(written(tmp_path, torque_Nm=nothing))["torque_Nm"]).all()


NO_TEXT = pa.StringArray.from_buffers(
    2, pa.py_buffer(np.asarray([0, 1, 2], np.int32)), pa.py_buffer(b"\xff\xfe")
)
FAULTS = {
    "wrong unit": ({"load_kN": [1.0, 1.0]}, "load is read in N"),
    "misspelt column": ({"torqe_Nm": [1.0, 1.0]}, "did you mean 'torque_Nm'"),
    "extra column": ({"weather": ["dry", "wet"]}, "'weather' is not known"),
    "run missing": ({"run": ["a", None]}, "line 2, column run: the cell is blank"),
    "booleans": ({"torque_Nm": [True, False]}, "torque_Nm: has type bool; needed are numbers"),
    "digits in quotes": (
        {"torque_Nm": ["1", "2"]},
        "torque_Nm: has type string; needed are numbers",
    ),
    "times": ({"torque_Nm": [datetime.datetime(2024, 1, 1)] * 2}, "torque_Nm: has type timestamp"),
    "lists of runs": ({"run": [["a"], ["b"]]}, "column run: has type list"),
    "bytes that are no text": ({"run": NO_TEXT}, "column run: has text that is not UTF-8"),
    "infinity": ({"torque_Nm": [np.inf, 1.0]}, "line 1, column torque_Nm: inf given"),
}


@pytest.mark.parametrize("what", FAULTS)
def test_faults_are_named_by_file_and_column(tmp_path, what):
    columns, said = FAULTS[what]
    with pytest.raises(TableError) as caught:
        read_table(written(tmp_path, **columns), RUNS)
    assert said in str(caught.value) and "runs.parquet" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_column_that_stands_twice_is_refused(tmp_path):
    table = pa.table([[1.0], [2.0]], names=["slip", "slip"])
    pq.write_table(table, tmp_path / "twice.parquet")
    with pytest.raises(TableError, match="slip occurs twice"):
        read_table(tmp_path / "twice.parquet")


def test_extra_columns_can_be_passed_over_and_a_file_s_own_are_known(tmp_path):
    path = written(tmp_path, weather=["dry", "wet"])
    assert "weather" not in read_table(path, ignore_extra=True)
    path = written(
        tmp_path, {"soilml_units": '{"slip-sinkage.n1": "1"}'}, **{"slip-sinkage.n1": [1, 2]}
    )
    assert read_table(path)["slip-sinkage.n1"].tolist() == [1.0, 2.0]
    for units in ("{", "3", "[" * 100_000):
        assert len(read_table(written(tmp_path, {"soilml_units": units}))) == 2


def test_a_checksum_without_its_recipe_is_refused(tmp_path):
    with pytest.raises(TableError, match="the checksum of a recipe and no recipe"):
        read_table(written(tmp_path, {"soilml_recipe_sha256": "0" * 64}))


def test_a_changed_byte_of_a_generated_file_is_found(tmp_path, small_data):
    whole = bytearray(small_data.read_bytes())
    for place in (1000, len(whole) // 2):
        damaged = bytearray(whole)
        damaged[place] ^= 1
        (tmp_path / "damaged.parquet").write_bytes(damaged)
        with pytest.raises(TableError, match=r"not a complete Parquet file"):
            read_table(tmp_path / "damaged.parquet")
    content = pq.ParquetFile(small_data).read()
    pq.write_table(content, tmp_path / "plain.parquet", compression="none")
    assert len(read_table(tmp_path / "plain.parquet")) == len(content)  # none written, none asked


def test_no_thread_of_arrow_needs_the_interpreter(tmp_path, monkeypatch):
    """Else a command that ends right after it has read a file is aborted now and then."""
    sources, read = [], pq.ParquetFile
    monkeypatch.setattr(pq, "ParquetFile", lambda s, **o: (sources.append(s), read(s, **o))[1])
    assert len(read_table(written(tmp_path))) == 2
    assert {type(source) for source in sources} == {pa.OSFile}


def test_a_name_of_any_bytes_is_read(tmp_path):
    path = written(tmp_path).rename(tmp_path / "x\udcff.parquet")
    assert len(read_table(path)) == 2


def test_a_folder_without_parquet_files_is_no_table(tmp_path):
    (tmp_path / "folder.parquet").mkdir()
    for name, said in (
        ("", "Is a dir"),
        ("folder.parquet", "Is a dir"),
        ("none.parquet", "no such"),
    ):
        with pytest.raises(TableError, match=said):
            read_table(tmp_path / name)
