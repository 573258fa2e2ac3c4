"""Slip without odometry: force balance, hard floors, what is not determined, bad tables."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[3] / "bench"))

from slip_drives import loads, simulate_drive

from soilml import Operating, read_case
from soilml.errors import InputError, TableError
from soilml.slip_filter.drive import read_drive, slip_of_drive
from soilml.slip_filter.filter import SlipFilter, travel_ratio
from soilml.slip_filter.force_table import force_table
from soilml.traction.draws import SoilDraws

ROVER = Path(__file__).parents[3] / "examples/slip/rover.toml"
SOILS = 512


@pytest.fixture(scope="module")
def case():
    return read_case(ROVER)


@pytest.fixture(scope="module")
def drive():
    return simulate_drive(11, soils=1, rows=24)


def code_of(found):
    return {remark.code for remark in found.remarks()}


def test_loads_shift_to_the_lower_side_by_the_moments(case):
    roll = 0.2
    found = case.rover.loads(0.0, roll)
    weight, share = 30 * 9.80665, 0.25 * np.cos(roll)
    shift = 0.25 * np.sin(roll) * 0.3 / 0.3  # height over half the track
    assert found == pytest.approx(weight * np.asarray([share - shift, share + shift] * 2))


def test_with_a_known_soil_the_wheels_pull_what_the_slope_requires(case):
    names = tuple(case.prior)
    soil = [1500.0, 0.6, 0.015, 1.5e6, 1.0]
    exact = replace(case, drive=replace(case.drive, pull_std=1e-4, slope_std=0.0, speed_std=0.0))
    known = force_table(exact, (20.0, 140.0), soils=SoilDraws(names, np.tile(soil, (64, 1))))
    filter_ = SlipFilter(known, case.rover.weight, exact.drive)
    own = case.with_values(dict(zip(names, soil, strict=True)))
    for slope in (-0.05, 0.1, 0.2):
        load = loads(np.asarray(slope))
        answer, _ = filter_.step(filter_.start(), np.full(4, 0.1), np.full(4, np.nan), load, slope)
        slip = answer.slip[1]
        assert slip == pytest.approx(slip[0])
        pull = own.model(own.soil, Operating(slip=slip, load=load)).drawbar_pull.sum()
        assert pull == pytest.approx(
            case.rover.weight * np.sin(slope), abs=0.01 * case.rover.weight
        )
        assert answer.speed[1] == pytest.approx(0.1 * travel_ratio(slip[:1])[0])


def test_a_hard_floor_is_refused_and_a_soil_is_not(case, drive):
    floor = simulate_drive(12, soils=1, rows=24, floor=True)
    found = slip_of_drive(case, floor.columns(), soils=SOILS)
    assert all("no-soil" in own for own in found.flags[10:])
    assert not found.answered[10:].any()
    assert "no-soil" in code_of(found)
    assert "no-soil" not in code_of(slip_of_drive(case, drive.columns(), soils=SOILS))


def test_in_reverse_the_answer_is_that_of_forward_up_the_same_slope(case, drive):
    columns = drive.columns() | {"load_N": loads(drive.slope).ravel()}
    back = columns | {n: -columns[n] for n in ("rim_speed_m_s", "torque_Nm", "slope_rad")}
    there, here = (slip_of_drive(case, own, soils=SOILS) for own in (columns, back))
    assert here.slip == pytest.approx(there.slip, nan_ok=True)
    assert here.speed == pytest.approx(-there.speed[:, ::-1], nan_ok=True)


def test_currents_and_rotation_are_torques_and_rim_speeds(case, drive):
    columns = drive.columns()
    other = {n: columns[n] for n in ("time_s", "wheel", "slope_rad")}
    other["current_A"] = columns["torque_Nm"] / 0.5
    other["wheel_speed_rad_s"] = columns["rim_speed_m_s"] / 0.15
    known = replace(case, drive=replace(case.drive, torque_per_ampere=0.5))
    one, two = read_drive(columns, case), read_drive(other, known)
    assert two.torque == pytest.approx(one.torque)
    assert two.rim_speed == pytest.approx(one.rim_speed)
    with pytest.raises(InputError, match="torque_per_ampere"):
        read_drive(other, case)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"slope_rad": None}, "column slope_rad is missing"),
        ({"torque_Nm": None}, "needed is torque_Nm or current_A"),
        ({"rim_speed_m_s": np.zeros(96)}, "all wheels stand still"),
        ({"slope_rad": np.full(96, 12.0)}, "a slope in rad"),
        ({"rim_speed_m_s": np.full(96, np.nan)}, "the cell is blank"),
        (
            {"rim_speed_m_s": np.where(np.arange(96) == 5, 1e20, 0.1)},
            "row 6, .* a speed between -100 and 100",
        ),
        ({"load_N": np.where(np.arange(96) == 5, 0.0, 70.0)}, "row 6, .* needed is a load above"),
        ({"torque_Nm": np.full(96, np.nan)}, "has no value"),
        ({"wheel": ["left"] * 96}, "wheels of .rover. are: front-left"),
        ({"time_s": np.arange(96.0)}, "one row for each of the 4 wheels"),
    ],
)
def test_a_bad_table_is_answered_in_one_line(case, drive, change, message):
    columns = drive.columns() | change
    columns = {name: values for name, values in columns.items() if values is not None}
    with pytest.raises(TableError, match=message) as error:
        read_drive(columns, case)
    assert "\n" not in str(error.value)
