"""Files, names and limits that once cost minutes, gigabytes or a terminal's state."""

import resource
import subprocess
import sys

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from conftest import THREE_CHANNEL_MODEL
from console import refused

from soilml.cli import main
from soilml.errors import InputError, TableError
from soilml.io.bounds import ROWS
from soilml.io.parquet import read_parquet
from soilml.io.toml_settings import read_settings

MARK = 'from pathlib import Path\n\nPath("it_ran").touch()\n'


@pytest.fixture
def folder(workplace):
    (workplace / "model.toml").write_text(THREE_CHANNEL_MODEL)
    (workplace / "own.py").write_text(MARK)
    return workplace


@pytest.mark.parametrize("form", ["{} = 1", "[{}]", "[[{}]]", "x = {{ {} = 1 }}", " {} =1"])
@pytest.mark.parametrize("part", ["a", '"a b"', "'a.b'", "a "])
def test_a_key_of_many_parts_is_refused_before_it_is_parsed(form, part, tmp_path):
    """Time and memory of the parser grow with the square: 40 000 parts took gigabytes."""
    file = tmp_path / "model.toml"
    file.write_text(form.format(".".join([part] * 40_000)) + "\n")
    with pytest.raises(InputError, match="a key has more than 20 parts"):
        read_settings(file)


@pytest.mark.slow
def test_a_parquet_file_of_more_rows_than_a_csv_file_may_have_is_refused(tmp_path):
    """Before it is read: a column that repeats one value takes some kB."""
    file = tmp_path / "rows.parquet"
    pq.write_table(pa.table({"slip": pa.array(np.zeros(ROWS.most + 1, np.int8))}), file)
    assert file.stat().st_size < 200_000
    with pytest.raises(TableError, match="more than 10000000 rows"):
        read_parquet(file)


@pytest.mark.parametrize("command", ["identify", "gap", "plan next", "pull", "plan effects"])
def test_a_file_of_effects_does_not_run_for_a_table_that_is_refused(command, folder, capsys):
    more = {"pull": ["--load", "60", "--slip-limit", "0.3"], "gap": ["--out", "gap"]}
    words = ["model.toml", "runs.csv", "--effects", "own.py", *more.get(command, [])]
    refused([*command.split(), *words], capsys, "no such file", folder)
    (folder / "runs.csv").write_text("run,slip,load_N,torque_Nm\na,0.1,60,text\n")
    refused([*command.split(), *words], capsys, "", folder)
    (folder / "model.toml").write_text("[gear\n")
    refused([*command.split(), *words], capsys, "", folder)


def test_names_of_outputs_are_printed_without_terminal_commands(folder, capsys):
    words = ["simulate", "model.toml", "--slip", "0.1,0.2", "--load", "60", "--out"]
    assert main([*words, "a\x1b[31m\rb.csv"]) == 0
    said = capsys.readouterr().err
    assert "a\\x1b[31m\\rb.csv" in said and "\x1b" not in said and "\r" not in said
    gear = ["--radius", "0.15", "--width", "0.12", "--soil", "wong1989/dry_sand"]
    assert main(["init", *gear, "a\x1b[31mb.toml"]) == 0
    assert "\x1b" not in capsys.readouterr().out


@pytest.mark.slow
def test_too_small_a_limit_of_memory_is_refused(folder):
    """The numerical libraries would ask for memory without end, and hear no signal."""
    (folder / "runs.csv").write_text("run,slip,load_N,torque_Nm\na,0.1,60,1.2\na,0.3,60,2.5\n")

    def limit():
        resource.setrlimit(resource.RLIMIT_AS, (260 << 20, 260 << 20))

    done = subprocess.run(
        [sys.executable, "-m", "soilml", "identify", "model.toml", "runs.csv"],
        preexec_fn=limit,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 2 and done.stderr.count("\n") == 1
    assert "this process may use 260 MB of memory" in done.stderr
