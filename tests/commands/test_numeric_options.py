"""Every option that is a number states its range, and no number ends in more than one line."""

import argparse
import warnings
from pathlib import Path

import numpy as np
import pytest
from conftest import THREE_CHANNEL_MODEL

from soilml.cli import main
from soilml.cli.main import parser
from soilml.cli.option_values import NumberFrom, named_numbers
from soilml.cli.options import leaves

HOSTILE = ["nan", "inf", "-inf", "0", "-1", "1e-9", "1e9", "-1e9", "1e400", "x", ""]
#: Options whose text holds numbers, which their command reads.
OF_TEXT = {
    "init": ["--radius", "--width"],
    "simulate": ["--slip", "--load"],
    "plan next": ["--slip", "--load"],
    "pull": ["--load", "--slope", "--gravity", "--tested-at"],
    "paper walk": ["--legs", "--stiffness", "--slip"],
}


def options():
    """Each option of each command that takes a value."""
    for command, own in leaves(parser()):
        for action in own._actions:
            if action.option_strings and action.nargs != 0:
                yield command, action


NUMBERS = [(words, action) for words, action in options() if isinstance(action.type, NumberFrom)]


def test_no_option_is_a_number_without_a_range():
    free = [(w, a.option_strings) for w, a in options() if a.type in (int, float)]
    assert not free and len(NUMBERS) > 30


@pytest.mark.parametrize("text", HOSTILE)
def test_a_number_beyond_its_range_is_refused_in_one_line(text):
    """At the parser, which each command goes through."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for words, action in NUMBERS:
            try:
                value = action.type(text)
            except argparse.ArgumentTypeError as error:
                assert "\n" not in str(error) and "needed is" in str(error), (words, action)
                continue
            assert np.isfinite(value), (words, action.option_strings)
            assert action.type.lower <= value <= action.type.upper


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    work = tmp_path_factory.mktemp("numbers")
    (work / "m.toml").write_text(THREE_CHANNEL_MODEL)
    (work / "r.csv").write_text(
        "run,slip,load_N,torque_Nm\na,0.1,60,1.26\na,0.2,60,1.9\na,0.4,60,2.6\na,0.6,60,3.0\n"
    )
    return work


WORDS = {
    "init": ["init", "new.toml", "--radius", "0.15", "--width", "0.12"],
    "simulate": ["simulate", "m.toml", "--slip", "0.2", "--load", "60"],
    "plan next": ["plan", "next", "m.toml", "r.csv", "--exact-model"],
    "pull": ["pull", "m.toml", "r.csv", "--load", "60", "--exact-model"],
    "paper walk": ["paper", "walk"],
}  # fmt: skip
CHEAP = [(c, o) for c in ("init", "simulate", "paper walk") for o in OF_TEXT[c]]
CHEAP += [(w, a.option_strings[0]) for w, a in NUMBERS if w in ("simulate", "paper walk")]
LONG = [(c, o) for c in ("plan next", "pull") for o in OF_TEXT[c]]


def run(words, folder, monkeypatch, capsys):
    """Run a command; every warning is an error, and a refusal one line."""
    monkeypatch.chdir(folder)
    Path("new.toml").unlink(missing_ok=True)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        status = main(words)
    said = capsys.readouterr().err
    assert status in (0, 2) and "Traceback" not in said and "Warning" not in said, (words, said)
    assert status == 0 or said.count("\n") == 1, (words, said)


@pytest.mark.parametrize(
    ("command", "option"), [*CHEAP, *(pytest.param(*one, marks=pytest.mark.slow) for one in LONG)]
)
def test_a_command_answers_or_refuses_whatever_number_it_is_given(
    command, option, folder, monkeypatch, capsys
):
    few = ["nan", "-1", "1e9", "x"]  # of commands that take long
    for text in few if command in ("paper walk", "plan next", "pull") else HOSTILE:
        words = [*WORDS[command]]
        if option in words:
            words[words.index(option) + 1] = text
        else:
            words += [f"{option}={text}"]
        run(words, folder, monkeypatch, capsys)


def test_a_named_number_may_have_blanks_about_its_sign():
    assert named_numbers(["n = 0.7"], "--assume", "NAME=VALUE") == {"n": 0.7}
