"""Gravity on the command line: what is asked for is answered, what is none is refused in a line."""

import pytest
from conftest import MODEL

from soilml.cli import main

RUNS = "run,slip,load_N,torque_Nm\na,0.1,40,1.5\na,0.2,80,4.8\na,0.3,40,2.8\n"
ROVER = """\
[rover]
mass = 30.0
centre_of_mass = [0.0, 0.0, 0.2]
[rover.wheels]
front = { position = [0.4, 0.0] }
rear = { position = [-0.4, 0.0] }
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "model.toml").write_text(MODEL)
    (tmp_path / "rover.toml").write_text(MODEL + ROVER)
    (tmp_path / "runs.csv").write_text(RUNS)
    return tmp_path


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("pull model.toml runs.csv --gravity 0", "gravity is 0 m/s^2; needed is"),
        ("pull rover.toml runs.csv --gravity pluto", "one of earth, moon, mars"),
        ("pull model.toml runs.csv --gravity moon --gravity-law bekker", "one of open, constant"),
        ("pull rover.toml runs.csv --tested-at earth", "--tested-at needs --gravity"),
        ("advise model.toml --gravity moon", "needs --target-load"),
        ("advise model.toml --gravity moon --target-load 20 --radius -1", "radius -1 m"),
        ("advise model.toml --load 20 --radius 0.1", "--radius needs --gravity"),
    ],
)
def test_what_is_none_is_refused_in_one_line(folder, capsys, words, said):
    assert main([*words.split(), "--out", "out.csv"]) == 2
    error = capsys.readouterr().err.strip().splitlines()[-1]
    assert error.startswith("soilml: ") and said in error
    assert not (folder / "out.csv").exists()


@pytest.mark.slow
def test_pull_says_what_the_law_costs_and_advise_what_no_test_tells(folder, capsys):
    asked = ["--gravity", "moon", "--exact-model", "--out", "out.csv"]
    for words, name in (("model.toml --load 20", "largest_pull_N"), ("rover.toml", "steepest_deg")):
        assert main(["pull", *words.split()[:1], "runs.csv", *words.split()[1:], *asked]) == 0
        assert f"of the band of {name}" in capsys.readouterr().out
    assert main(["advise", "rover.toml", *asked]) == 0
    assert "no test under 9.81 m/s^2 tells the law of gravity" in capsys.readouterr().err
    rows = [line.split(",") for line in (folder / "out.csv").read_text().splitlines()]
    loads = {row[0]: float(row[1]) for row in rows[1:]}
    assert loads["same load"] == pytest.approx(30.0 * 1.62 / 2)
    assert loads["same mass"] == pytest.approx(30.0 * 9.80665 / 2)
