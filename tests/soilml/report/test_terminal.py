"""Numbers on a terminal: usual units, and as many digits as are known."""

import pytest

from soilml.report.terminal import interval, rounded, significant


@pytest.mark.parametrize(
    ("x", "std", "text"),
    [
        (1050.94, 105.92, "1050"),
        (28.0945, 0.99989, "28.09"),
        (0.0, 0.012, "0.000"),
        (-0.0004, 0.012, "0.000"),
        (0.5, float("nan"), "0.5"),
        (float("nan"), 1.0, ""),
        (2.3e9, 1.1e8, "2.3e+09"),
    ],
)
def test_numbers_are_rounded_by_their_standard_deviation(x, std, text):
    assert rounded(x, std) == text


def test_an_interval_has_the_digits_of_its_width():
    assert interval(0.87798, 1.22693, 0.105921) == "0.88 .. 1.23"
    assert [significant(x) for x in (-123456.0, float("inf"))] == ["-123456", "inf"]
