"""Text that commands print: JSON without numbers that JSON does not have."""

import json

import pytest

from soilml.cli.output import json_text


def test_numbers_that_are_not_finite_become_null_and_texts_stay():
    content = {"Infinity": [1.5, float("inf"), (-float("inf"), float("nan"))], "note": "Infinity"}
    text = json_text(content)
    read = json.loads(text, parse_constant=pytest.fail)
    assert read == {"Infinity": [1.5, None, [None, None]], "note": "Infinity"}
