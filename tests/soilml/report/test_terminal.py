"""Numbers on a terminal: usual units, and as many digits as are known."""

import pytest

from soilml.report.terminal import interval, rounded, shown_column, shown_unit, significant


@pytest.mark.parametrize(
    ("name", "shown"),
    [
        ("cohesion_Pa", "cohesion_kPa"),
        ("friction_angle_rad_usual_p05", "friction_angle_deg_usual_p05"),
        ("sinkage_m_front-left", "sinkage_mm_front-left"),
        ("shear_modulus_m_std", "shear_modulus_mm_std"),
        ("speed_m_s", "speed_m_s"),
        ("vibration_m_s2", "vibration_m_s2"),
        ("torque_Nm", "torque_Nm"),
        ("slip", "slip"),
    ],
)
def test_columns_are_named_in_the_unit_that_they_are_shown_in(name, shown):
    assert shown_column(name)[1] == shown


def test_units_of_moduli_follow_their_size():
    assert shown_unit("N/m^(n+1)", 990.0) == (1.0, "N/m^(n+1)")
    assert shown_unit("N/m^(n+2)", 2.0e4) == (1e-3, "kN/m^(n+2)")
    assert shown_unit("1") == shown_unit("-") == (1.0, "")


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
