"""Data in a folder of files: the rows of one file, completed after an interruption."""

import functools
from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from conftest import RECIPE

from datagen.generate import WRITER, generate, generate_folder
from datagen.recipe import read_recipe
from datagen.simulation import pieces
from soilml.errors import InputError
from soilml.io.read_table import read_table
from soilml.processes import process_map

BLOCKS = "[[runs]]\nrows = 1\nshare = 0.6\n[[runs]]\nrows = 8\nshare = 0.4\n"


@pytest.fixture
def recipe(tmp_path):
    (tmp_path / "recipe.toml").write_text(RECIPE.format(rows=2000, seed=1) + BLOCKS)
    return read_recipe(tmp_path / "recipe.toml")


@pytest.fixture
def make(recipe, tmp_path):
    def made(of=recipe, workers=1):
        engine = functools.partial(process_map, workers=workers)
        return generate_folder(of, tmp_path / "data", engine=engine, rows_per_file=256)

    return made


def test_the_files_have_the_rows_of_one_file_in_order(recipe, make, tmp_path, monkeypatch):
    monkeypatch.setattr("datagen.generate.pieces", functools.partial(pieces, size=256))
    generate(recipe, tmp_path / "one.parquet")
    result = make(workers=2)
    assert (result.rows, result.failed, result.kept) == (2000, 0, 0)
    files = sorted((tmp_path / "data").iterdir())
    assert [file.name for file in files] == [f"part-{i:06d}.parquet" for i in range(9)]
    tables = [pq.ParquetFile(file).read() for file in files]
    assert pa.concat_tables([t.replace_schema_metadata() for t in tables]).equals(
        pq.read_table(tmp_path / "one.parquet").replace_schema_metadata()
    )
    folder, one = read_table(tmp_path / "data"), read_table(tmp_path / "one.parquet")
    assert folder.metadata == one.metadata
    for name, values in one.columns.items():
        np.testing.assert_array_equal(folder[name], values)


def changed_rows(file, column, row):
    """The same file, whole and with right checksums, but one value differs."""
    table = pq.ParquetFile(file).read()
    values = table[column].to_numpy().copy()
    values[row] *= 1.001
    index = table.schema.get_field_index(column)
    table = table.set_column(index, table.schema.field(column), pa.array(values))
    pq.write_table(table, file, **WRITER)


def test_files_that_are_right_are_kept_and_others_are_written_again(make, tmp_path):
    make()
    files = sorted((tmp_path / "data").iterdir())
    before = [file.read_bytes() for file in files]
    assert make().kept == 2000
    files[1].unlink()
    content = bytearray(before[2])
    content[300] ^= 1
    files[2].write_bytes(content)
    files[3].write_bytes(before[3][:-200])
    changed_rows(files[4], "torque_Nm", 0)
    times = [file.stat().st_mtime_ns for file in files if file.exists()]
    result = make()
    assert result.kept == 2000 - sum(pq.read_metadata(files[i]).num_rows for i in (1, 2, 3, 4))
    assert [file.read_bytes() for file in files] == before
    assert files[0].stat().st_mtime_ns == times[0]


def test_a_disk_that_is_too_small_is_refused_before_anything_is_written(
    recipe, tmp_path, monkeypatch
):
    many = recipe.sized(rows=100_000)
    disk = SimpleNamespace(free=0)
    monkeypatch.setattr("shutil.disk_usage", lambda path: disk)
    said = r"100000 rows take about 0\.00\d+ GB; .* has 0 GB free"
    for write, name in ((generate, "d.parquet"), (generate_folder, "data")):
        with pytest.raises(InputError, match=said):
            write(many, tmp_path / name)
    assert [file.name for file in tmp_path.iterdir()] == ["recipe.toml"]
