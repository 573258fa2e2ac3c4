"""The commands are there whether the package is installed or only on the path."""

import argparse
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from soilml.cli.main import COMMANDS, GROUPS, main, parser

ROOT = Path(__file__).parents[2]

#: A line of the list of commands: four spaces, the name, its help.
COMMAND = re.compile(r" {4}[a-z-]+(\s|$)")

#: A process that finds no distribution, as on a machine with PYTHONPATH only.
WITHOUT_ENTRY_POINTS = """\
import importlib.metadata, sys
importlib.metadata.entry_points = lambda **_: ()
from soilml.cli.main import main
sys.exit(main())
"""


@pytest.mark.slow
def test_every_command_is_there_without_entry_points(tmp_path):
    for words in (["--help"], ["generate", "--help"], ["compare", "--help"]):
        done = subprocess.run(
            [sys.executable, "-c", WITHOUT_ENTRY_POINTS, *words],
            cwd=tmp_path,
            env=os.environ | {"PYTHONPATH": str(ROOT)},
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stderr
        if words == ["--help"]:
            listed = {line.split()[0] for line in done.stdout.splitlines() if COMMAND.match(line)}
            grouped = {name for own in GROUPS.values() for name in own.values()}
            assert listed == set(COMMANDS) - grouped | set(GROUPS)


def options():
    """Command and action of every option and argument of all commands."""
    commands = next(action for action in parser()._actions if action.choices)
    for name in COMMANDS:
        sub = commands.choices[name]
        for action in sub._actions:
            yield name, action


def test_shared_options_mean_the_same_in_all_commands():
    """One word, one meaning: -q, -v, -o and --format, of which none has a default."""
    texts, have = {}, {}
    for name, action in options():
        for word in action.option_strings:
            have.setdefault(word, set()).add(name)
        if "--format" in action.option_strings:
            assert set(action.choices) in ({"table", "csv", "json"}, {"table", "json"}), name
            assert action.default is None
        for word in {"-q", "-v", "--format"} & set(action.option_strings):
            texts.setdefault(word, set()).add(action.help)
    assert have["-q"] == have["--quiet"] == have["-v"] == have["--verbose"] == set(COMMANDS)
    assert have["-o"] == have["--out"]
    assert all(len(said) == 1 for said in texts.values())


def test_words_of_quantities_have_one_unit():
    units = {"--load": "N", "--slope": "degrees", "--speed": "m/s"}
    for name, action in options():
        if action.help == argparse.SUPPRESS:  # an older name
            continue
        assert not {"--slips", "--loads"} & set(action.option_strings)
        for word in set(units) & set(action.option_strings):
            said = f"{action.help} "
            assert f"in {units[word]}" in said or f" {units[word]} " in said, (name, word)


def test_commands_of_two_words_and_their_older_names(capsys):
    for group, own in GROUPS.items():
        for word, name in own.items():
            assert main([group, word, "--help"]) == 0
            assert f"usage: soilml {group} {word} " in capsys.readouterr().out
            assert main([name, "--help"]) == 0
            assert f"usage: soilml {group} {word} " in capsys.readouterr().out
    assert main(["export"]) == main(["export", "d"]) == 2
    assert "soilml export: needed is one of: c, fusion, step" in capsys.readouterr().err


def test_the_bare_command_prints_its_help(capsys):
    assert main([]) == 0
    said = capsys.readouterr().out
    assert "from a log to a table" in said and "plan" in said
