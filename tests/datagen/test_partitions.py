"""Data in a folder of files: the rows of one file, completed after an interruption."""

import functools
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from conftest import RECIPE

from datagen.generate import WRITER, generate, generate_folder
from datagen.recipe import read_recipe
from datagen.simulation import pieces
from soilml.cli import main
from soilml.errors import InputError, TableError
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


def test_data_of_another_recipe_are_not_mixed_in(recipe, make, tmp_path):
    make()
    other = tmp_path / "data" / "mine.parquet"
    with pytest.raises(InputError, match="of another recipe, seed, number of rows or version"):
        make(recipe.sized(seed=2))
    with pytest.raises(InputError, match="of another recipe"):
        make(recipe.sized(rows=1992))
    other.write_bytes(b"")
    with pytest.raises(InputError, match=r"mine\.parquet is of another recipe"):
        make()


def test_remains_of_killed_workers_are_removed(make, tmp_path):
    (tmp_path / "data").mkdir()
    left = tmp_path / "data" / ".part-000001.parquet.0badcafe.part"
    left.write_bytes(b"half")
    make()
    assert not left.exists()


def test_an_incomplete_folder_is_no_table(make, tmp_path):
    make()
    first, second, *_ = sorted((tmp_path / "data").iterdir())
    first.unlink()
    with pytest.raises(TableError, match=r"has 1744 of 2000 rows: .* the same command completes"):
        read_table(tmp_path / "data")
    table = pq.ParquetFile(second).read()
    pq.write_table(table.replace_schema_metadata({"soilml_rows": "2000"}), second)
    with pytest.raises(TableError, match="not of one table"):
        read_table(tmp_path / "data")
    for file in (tmp_path / "data").iterdir():
        file.unlink()
    with pytest.raises(TableError, match="without a Parquet file"):
        read_table(tmp_path / "data")


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


def test_a_recipe_that_mostly_fails_leaves_no_folder(recipe, tmp_path):
    heavy = replace(recipe, load=replace(recipe.load, lower=3e4, upper=1.2e5))
    with pytest.raises(InputError, match="no equilibrium"):
        generate_folder(heavy, tmp_path / "data")
    assert not (tmp_path / "data").exists()


@pytest.mark.slow
def test_commands_write_and_train_from_a_folder(recipe, tmp_path, capsys):
    data, model = f"{tmp_path}/data/", str(tmp_path / "model.onnx")
    (tmp_path / "spec.toml").write_text('[[regressor]]\ntype = "linear"\n')
    command = ["generate", str(tmp_path / "recipe.toml"), data]
    assert main(command) == 0
    assert main(command) == 0
    assert "2000 of them there before" in capsys.readouterr().err
    assert main(["train", str(tmp_path / "spec.toml"), data, model]) == 0
    assert (tmp_path / "model.onnx").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["data/", "--workers", "0"], "whole number, 1 or more"),
        (["data/", "--scheduler", "tcp://127.0.0.1:1"], "--scheduler is for --engine dask"),
        (["d.parquet", "--engine", "cluster"], "invalid choice"),
        (
            ["data/", "--engine", "dask", "--scheduler", "tcp://127.0.0.1:1", "--workers", "2"],
            "omit --workers",
        ),
        (["missing/data/"], "does not exist; create it first"),
    ],
)
def test_mistakes_in_the_options_are_named(recipe, tmp_path, monkeypatch, capsys, words, said):
    monkeypatch.chdir(tmp_path)
    assert main(["generate", "recipe.toml", *words]) == 2
    error = capsys.readouterr().err
    assert said in error and len(error.splitlines()) == 1
