"""Numbers of the report are rounded to what is known of them."""

import pytest

from soilml.report import numbers


@pytest.mark.parametrize(
    ("value", "std", "text"),
    [
        (1406.28, 11.8, "1406 ± 12"),
        (-0.0071228, 2.9e-5, "(−7.123 ± 0.029) × 10⁻³"),
        (1343631.0, 170762.0, "(1.34 ± 0.17) × 10⁶"),
        (0.5, 0.0, "0.5000"),
    ],
)
def test_values_are_rounded_to_their_standard_deviation(value, std, text):
    assert numbers.format_with_std(value, std) == text


@pytest.mark.parametrize(
    ("x", "text"),
    [(320.18, "320"), (0.0, "0.00"), (3311.0, "3311"), (1.2e7, "1.20 × 10⁷"), (-0.05, "−0.0500")],
)
def test_numbers_have_three_significant_digits(x, text):
    assert numbers.format_number(x) == text
