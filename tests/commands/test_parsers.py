"""The parsers of all commands: one word has one meaning and one unit."""

import argparse
from collections import defaultdict

from soilml.cli import main, old_spellings
from soilml.cli.main import COMMANDS, GROUPS, parser
from soilml.cli.options import leaves

PARSERS = dict(leaves(parser()))


def options(name):
    return {o: a for a in PARSERS[name]._actions for o in a.option_strings}


def test_a_bare_word_prints_at_most_twenty_commands_in_eighty_columns(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    assert main([]) == 0
    said = capsys.readouterr().out
    listed = [
        line.split() for line in said.splitlines() if line.startswith("  ") and "--" not in line
    ]
    assert len(listed) <= 20 and max(map(len, said.splitlines())) <= 80
    named = {line[0] for line in listed if line[0] not in GROUPS}
    named |= {
        f"{line[0]} {word.strip(',:')}" for line in listed for word in line[1:] if line[0] in GROUPS
    }
    assert set(COMMANDS) == set(PARSERS) and set(COMMANDS) <= named


def test_help_fits_eighty_columns(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    for name, own in PARSERS.items():
        assert max(map(len, own.format_help().splitlines())) <= 80, name


def test_an_option_has_one_meaning_and_one_unit_everywhere():
    """The name of its value says both; a list of values has the name of one."""
    kinds = defaultdict(set)
    for name in PARSERS:
        for option, action in options(name).items():
            value = action.metavar or (None if action.choices is None else "choice")
            if option in ("-o", "--out"):  # a folder, or a file whose ending says its form
                assert value == "FOLDER" or "." in value, name
                assert {"-o", "--out"} <= set(action.option_strings)
                continue
            kinds[option].add((str(value).removesuffix(",..."), action.nargs))
    assert {option: kind for option, kind in kinds.items() if len(kind) > 1} == {}
    assert not any(
        kind[0].startswith("RAD") for own in kinds.values() for kind in own if kind[0] != "RAD_S"
    )
    near = [o for o in kinds if f"{o}s" in kinds and o != "--wheel"]
    assert near == []  # no --load beside --loads


def test_former_commands_lead_to_present_ones():
    for old in old_spellings.COMMANDS:
        assert old not in PARSERS
        words = old_spellings.present_words([old, "--help"])
        assert {words[0], " ".join(words[:-1])} & PARSERS.keys(), old


def test_former_options_lead_to_present_ones():
    former = [(c, *pair) for c, own in old_spellings.OPTIONS.items() for pair in own.items()]
    for command, old, new in former:
        words = command.split()
        assert old not in options(command) and new in options(command)
        said = old_spellings.present_words([*words, "in", old, "x", f"{old}=y"])
        assert said == [*words, "in", new, "x", f"{new}=y"]
        assert main([*words, old, "x", new, "y"]) == 2


def test_hints_at_former_words_are_for_a_terminal(monkeypatch, capsys):
    old_spellings.present_words(["advise", "--loads", "3"])
    assert capsys.readouterr().err == ""
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    old_spellings.present_words(["advise", "--loads", "3"])
    assert capsys.readouterr().err == (
        "! `soilml advise` is now `soilml plan next`\n! --loads is now --load\n"
    )


def test_every_command_explains_itself_with_an_example():
    for name, own in PARSERS.items():
        assert isinstance(own, argparse.ArgumentParser) and own.description.strip()
        assert f"soilml {name}" in own.description or name == "setup check", name
