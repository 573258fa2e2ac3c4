"""Repeated rows: their agreement, the words about the worst pair, and noise that is too large."""

from dataclasses import replace

import numpy as np
import pytest
from gap_sets import case_of, driven

from soilml.fitting.readings import stack_readings
from soilml.gap import gap
from soilml.gap.repeats import (
    repeat_disagreement,
)
from soilml.inference.gaussian_terms import scatter_columns
from soilml.io.table import Table
from soilml.physics.operating_point import Operating

TWICE = (40.0, 40.0, 60.0, 60.0, 90.0, 90.0)


def scaled(table, rows, factor, name="torque_Nm"):
    """The table with some readings multiplied."""
    values = table[name].copy()
    values[rows] *= factor
    return Table(table.columns | {name: values})


def test_repeats_with_the_declared_noise_agree():
    ratios, p_values = [], []
    for seed in range(40):
        case = case_of()
        found = repeat_disagreement(stack_readings(case, driven(case, loads=TWICE, seed=seed)))
        assert [f.degrees_of_freedom for f in found] == [24, 24, 24]
        ratios += [f.chi_square / f.degrees_of_freedom for f in found]
        p_values += [f.p_value for f in found]
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.1)
    assert np.mean(np.asarray(p_values) < 0.1) == pytest.approx(0.1, abs=0.06)


def test_runs_whose_torques_differ_are_told_in_words():
    case = case_of()
    table = scaled(driven(case, loads=TWICE, noise=0.0), slice(11, 12), 1.43)
    first = repeat_disagreement(stack_readings(case, table))[0]
    assert first.channel == "torque" and first.p_value < 0.01
    own = table["torque_Nm"]
    slip = table["slip"][3]
    assert first.sentence == (
        f"run run_0 and run run_1 at slip {slip:.2f} under 40 N: torque {own[3]:.3g} and "
        f"{own[11]:.3g} N m, which differ by 43 %"
    )


def test_usual_scatter_from_run_to_run_is_no_disagreement():
    soils = {"friction_angle": [0.52, 0.53, 0.515, 0.525, 0.52, 0.51]}
    case = case_of()
    readings = stack_readings(case, driven(case, loads=TWICE, soils=soils))
    strict = repeat_disagreement(readings)
    columns, run = scatter_columns(case, readings), readings.run[readings.row]
    scatter = np.where(run[:, None] == run, columns @ columns.T, 0.0)
    usual = repeat_disagreement(readings, np.diag(readings.std**2) + scatter)
    assert strict[0].p_value < 0.01
    assert all(f.p_value > 0.01 for f in usual)


def test_small_differences_of_slip_are_subtracted():
    case = case_of()
    table = driven(case, loads=TWICE, noise=0.0)
    slip = table["slip"] + np.where(np.arange(len(table)) % 16 < 8, 0.0, 0.01)
    force = case.model(case.soil, Operating(slip=slip, load=table["load_N"]))
    columns = {"slip": slip, "torque_Nm": force.torque}
    columns |= {"drawbar_pull_N": force.drawbar_pull, "sinkage_m": force.sinkage}
    readings = stack_readings(case, Table(table.columns | columns))
    raw = repeat_disagreement(readings)
    exact = repeat_disagreement(readings, expected=readings.measured)
    assert raw[0].chi_square > 10.0 and exact[0].chi_square == 0.0


def test_the_channel_whose_repeats_disagree_most_comes_first():
    case = case_of()
    readings = stack_readings(case, driven(case, loads=(40.0, 40.0, 90.0), noise=0.0))
    shift = {"torque": 30.0, "drawbar_pull": 90.0, "sinkage": 2.0}
    sizes = np.asarray([shift[name] for name in readings.channels])[readings.channel]
    second = readings.run[readings.row] == 1
    other = replace(
        readings, measured=readings.measured + np.where(second, sizes, 0.0) * readings.std
    )
    found = repeat_disagreement(other)
    assert [c.channel for c in found] == ["drawbar_pull", "torque", "sinkage"]
    assert found[0].p_value == found[1].p_value == 0.0 < found[2].p_value < 0.05
    expected = 8 * 90.0**2 / 2.0  # eight pairs, each with the variance of two readings
    assert found[0].chi_square == pytest.approx(expected, rel=1e-6)


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
