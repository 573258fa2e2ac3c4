"""Text that commands print: JSON without numbers that JSON does not have."""

import json

import pytest

from soilml.cli.output import show, tell
from soilml.report.page import json_text


def test_numbers_that_are_not_finite_become_null_and_texts_stay():
    content = {"Infinity": [1.5, float("inf"), (-float("inf"), float("nan"))], "note": "Infinity"}
    text = json_text(content)
    read = json.loads(text, parse_constant=pytest.fail)
    assert read == {"Infinity": [1.5, None, [None, None]], "note": "Infinity"}


def test_what_is_told_has_no_terminal_commands(capsys):
    for say, stream in ((tell, "err"), (show, "out")):
        say("an effect \x1b]0;named\x07 so\nand \u202eturned")
        said = getattr(capsys.readouterr(), stream)
        assert said == "an effect \\x1b]0;named\\x07 so\nand \\u202eturned\n"
