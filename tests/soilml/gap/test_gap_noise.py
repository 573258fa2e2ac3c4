"""Noise that is declared too large for the rows."""

import pytest
from gap_sets import case_of, driven

from soilml.gap import gap
from soilml.io.table import Table


def about_large_noise(table):
    """The channels of which a note says that their noise is declared too large, and the words."""
    notes = [n for n in gap(case_of(), table, effects={}).notes if n.code == "noise-too-large"]
    return {note.about[0]: note.text for note in notes}


def test_residuals_below_the_declared_noise_say_by_what_factor_it_is_too_large():
    case = case_of()
    actual = driven(case, noise=0.4, seed=2)["torque_Nm"]
    declared = driven(case, seed=3)
    found = about_large_noise(Table(declared.columns | {"torque_Nm": actual}))
    assert list(found) == ["torque_Nm"]
    factor = float(found["torque_Nm"].split(" times too large")[0].rpartition(" ")[2])
    assert factor == pytest.approx(1.0 / 0.4, rel=0.3)


def test_noise_as_declared_or_correlated_is_not_too_large():
    notes = [about_large_noise(driven(case_of(), seed=seed)) for seed in range(12)]
    assert sum(map(bool, notes)) <= 1
