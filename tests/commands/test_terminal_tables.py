"""What all commands print on a terminal: usual units, rounded numbers, at most 80 columns."""

from pathlib import Path

import pytest
from conftest import THREE_CHANNEL_MODEL
from console import check_tables

from soilml.cli import main
from soilml.cli.main import COMMANDS

ROOT = Path(__file__).parents[2]
RUNS = """\
run,slip,load_N,torque_Nm,drawbar_pull_N,sinkage_m
a,0.1,40,0.75,-3.1,0.0112
a,0.3,80,3.2,1.4,0.0197
a,0.5,40,1.95,5.1,0.0117
b,0.1,80,1.8,-7.6,0.0194
b,0.3,40,1.4,1.6,0.0115
b,0.5,80,4.1,7.2,0.0199
"""
PLATES = "test,plate_radius_m,sinkage_m,load_N\n" + "".join(
    f"p{i},{r},{z},{3.1415 * r * r * 1528e3 * z**1.1:.4g}\n"
    for i, r in enumerate((0.04, 0.06))
    for z in (0.005, 0.01, 0.02, 0.03)
)
WORDS = {
    "show": ["soils"],
    "simulate": ["m.toml", "--slip", "0.1,0.5", "--load", "60,1e6", "--speed", "0.1"],
    "bevameter": ["plates.csv"],
    "plan effects": ["m.toml", "runs.csv", "--ignore-extra", "-v"],
    "plan next": ["m.toml", "runs.csv"],
    "pull": ["m.toml", "runs.csv", "--load", "60", "--slip-limit", "0.3"],
    "plan wheels": ["rover.toml", "--designs", "9", "--draws", "50"],
    "paper walk": ["--ground", "SSC-1,SSC-2", "--legs", "5"],
    "paper numbers": ["comin2017-slip"],
}
#: Commands whose tables have tests of their own, or that print none.
ELSEWHERE = {
    *("identify", "estimate", "pull", "gap", "setup check"),
    *("init", "example", "setup completion", "serve", "import", "generate", "train", "adapt"),
    *("compare", "plan runs", "export c", "export slip"),
    "export soil",  # in the units of the program that it writes for
    *("drive slip", "drive map", "paper climb", "paper wheel-leg", "paper sensor-wheel"),
    "paper track",
}


def test_every_command_is_looked_at():
    assert {*WORDS, *ELSEWHERE} == set(COMMANDS)


@pytest.mark.slow
@pytest.mark.parametrize("command", [c for c in WORDS if c != "paper numbers"])
def test_tables_are_narrow_rounded_and_in_usual_units(command, workplace, capsys):
    (workplace / "m.toml").write_text(THREE_CHANNEL_MODEL)
    (workplace / "runs.csv").write_text(RUNS)
    (workplace / "plates.csv").write_text(PLATES)
    (workplace / "rover.toml").write_text((ROOT / "examples/design/rover.toml").read_text())
    assert main([*command.split(), *WORDS[command]]) == 0
    check_tables(capsys.readouterr().out)
