"""One way to choose rows and gear, for all commands that read rows."""

from argparse import Namespace

import pytest
from conftest import MODEL

from soilml.cli import main
from soilml.cli.tables import read_case_of_rows, read_rows
from soilml.errors import InputError, TableError
from soilml.io.read_table import RUNS

ROWS = "run,gear,slip,load_N,torque_Nm\na,narrow,0.1,60,1\na,narrow,0.3,60,2\nb,wide,0.2,60,2\n"


@pytest.fixture
def files(workplace):
    (workplace / "one.toml").write_text(MODEL)
    start = MODEL.index("[gear]")
    stop = MODEL.index("\n[", start + 1)
    gear = MODEL[start:stop]
    several = [gear.replace("[gear]", f"[gears.{name}]") for name in ("narrow", "wide")]
    (workplace / "two.toml").write_text(MODEL.replace(gear, "\n".join(several)))
    (workplace / "runs.csv").write_text(ROWS)
    return workplace


def chosen(model, where=None, gear=None, rows=ROWS):
    args = Namespace(runs="runs.csv", where=where, gear=gear, ignore_extra=False)
    table = read_rows(args, RUNS)
    return len(table), read_case_of_rows(args, model, table)


def test_what_is_not_chosen_is_asked_for(files):
    with pytest.raises(InputError, match="choose one with --gear, which also selects its rows"):
        chosen("two.toml")
    with pytest.raises(TableError, match="no row has gear = round; values are narrow, wide"):
        chosen("two.toml", gear="round")
    (files / "runs.csv").write_text(ROWS.replace("gear,", "").replace("narrow,", "")
                                    .replace("wide,", ""))  # fmt: skip
    with pytest.raises(InputError, match=r"one\.toml has one gear, in \[gear\]; omit --gear"):
        chosen("one.toml", gear="wide")


@pytest.mark.slow
def test_identify_takes_the_rows_of_one_gear(files, capsys):
    words = ["identify", "two.toml", "runs.csv", "--method", "nonlinear", "--free", "cohesion"]
    assert main([*words, "--gear", "narrow"]) == 0
    by_option = capsys.readouterr().out
    assert main([*words, "--where", "gear=narrow"]) == 0
    assert capsys.readouterr().out == by_option
