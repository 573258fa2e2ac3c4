"""Readings of all channels in one vector: noise, order, parts and the largest size."""

from dataclasses import replace

import numpy as np
import pytest
from gap_sets import MODEL, case_of, driven

from soilml.errors import InputError
from soilml.fitting.readings import stack_readings, typical_std
from soilml.gap.workflow import MOST_READINGS, _check_size
from soilml.io.table import Table
from soilml.physics.effects.base import REFERENCE_LOAD, log_relative_slip

SMALL = Table(
    {
        "run": np.asarray(["b", "a", "b", "a", "a"]),
        "time_s": np.asarray([2.0, 9.0, 1.0, 7.0, 8.0]),
        "slip": np.asarray([0.1, 0.2, 0.3, 0.4, 0.5]),
        "load_N": np.asarray([40.0, 50.0, 60.0, 70.0, 80.0]),
        "torque_Nm": np.asarray([1.0, 2.0, np.nan, 4.0, 5.0]),
        "torque_Nm_std": np.asarray([0.1, 0.0, 0.3, -0.4, 0.5]),
        "sinkage_m": np.asarray([0.01, 0.02, 0.03, 0.04, np.inf]),
        "slip_std": np.asarray([0.01, 0.02, 0.0, 0.03, 0.05]),
    }
)


def stacked(table=SMALL):
    return stack_readings(case_of(), table)


def test_finite_readings_are_stacked_by_channel():
    found = stacked()
    assert found.channels == ("torque", "sinkage") and len(found) == 8
    assert found.row.tolist() == [0, 1, 3, 4, 0, 1, 2, 3]
    assert found.channel.tolist() == [0] * 4 + [1] * 4
    assert found.measured.tolist() == [1.0, 2.0, 4.0, 5.0, 0.01, 0.02, 0.03, 0.04]
    assert (found.runs, found.run.tolist()) == (("a", "b"), [1, 0, 1, 0, 0])
    assert found.order.tolist() == [1, 2, 0, 0, 1]  # by time within a run
    assert found.slip.tolist() == [0.1, 0.2, 0.4, 0.5, 0.1, 0.2, 0.3, 0.4]
    assert found.load.tolist() == [40.0, 50.0, 70.0, 80.0, 40.0, 50.0, 60.0, 70.0]
    slip, load = found.log_slip_and_load
    assert load == pytest.approx(np.log(found.load) - np.log(REFERENCE_LOAD))
    assert slip == pytest.approx(log_relative_slip(found.slip))
    force = {"torque": np.arange(5.0), "sinkage": 10.0 + np.arange(5.0)}
    assert found.stack(force).tolist() == [0.0, 1.0, 3.0, 4.0, 10.0, 11.0, 12.0, 13.0]
    both = found.stack({name: np.stack([v, -v]) for name, v in force.items()})
    assert both.tolist() == [found.stack(force).tolist(), (-found.stack(force)).tolist()]


def test_rows_without_time_are_in_their_order():
    table = Table({name: SMALL[name] for name in ("run", "slip", "load_N", "torque_Nm")})
    assert stacked(table).order.tolist() == [0, 0, 1, 1, 2]
    several = Table({**table.columns, "run": np.asarray(["c", "a", "b", "c", "a"])})
    assert stacked(several).order.tolist() == [0, 0, 0, 1, 1]


def test_a_table_without_a_reading_has_none():
    table = Table({name: SMALL[name] for name in ("run", "slip", "load_N")})
    found = stacked(table)
    assert (len(found), found.channels, found.noise) == (0, (), ())
    assert found.row.size == found.channel.size == found.std.size == 0
    assert found.slip_std.tolist() == found.load_std.tolist() == [0.0] * 5


def test_levels_are_those_of_each_reading():
    found = stack_readings(case_of(), driven(case_of(), loads=(40.0, 60.0, 90.0), slips=4))
    part = found.subset(found.load > 50.0)  # rows without a reading have no level
    for levels, values, count in (
        (part.load_levels, part.load, 2),
        (part.slip_levels, part.slip, 4),
    ):
        assert levels.count == count and levels.index.shape == values.shape
        expected = np.unique(values, return_inverse=True)[1]
        assert levels.index.tolist() == expected.tolist()


def test_noise_that_is_not_positive_is_not_declared():
    found = stacked()
    assert found.std[:4] == pytest.approx([0.1, np.nan, np.nan, 0.5], nan_ok=True)
    noise = case_of().noise
    assert found.noise == (noise["torque_Nm"], noise["sinkage_m"])
    assert found.from_case.tolist() == [False] * 4 + [True] * 4  # the table has that of torque
    assert found.slip_std.tolist() == [0.01, 0.02, 0.0, 0.03, 0.05]
    assert typical_std(found.slip_std) == pytest.approx(0.025)  # the median of those above zero
    assert not found.load_std.any() and typical_std(found.load_std) == 0.0
    elsewhere = found.noise_at(2.0 * found.measured)
    assert elsewhere[:4] == pytest.approx(found.std[:4], nan_ok=True)
    assert elsewhere[4:] == pytest.approx(noise["sinkage_m"].std(2.0 * found.measured[4:]))
    usual = found.with_default_std({"torque": 0.7})
    assert usual.std[:4] == pytest.approx([0.1, 0.7, 0.7, 0.5])
    assert usual.std[4:].tolist() == found.std[4:].tolist()


def test_noise_is_that_of_expected_values_and_never_nothing():
    case = case_of()
    found = stack_readings(case, driven(case))
    noise = case.noise["torque_Nm"]
    torque = found.channel == found.channels.index("torque")
    expected = 2.0 * found.measured
    expected[0] = 0.0
    other = replace(noise, share=3.0 * noise.share)
    std = replace(found, noise=(noise, other, other)).with_noise_at(expected).std
    floor = 1e-3 * np.median(found.std[torque])
    own = np.maximum(noise.std(expected[torque]), floor)
    assert std[torque] == pytest.approx(own, rel=1e-12) and std[torque].min() > 0.0
    floors = np.asarray([1e-3 * np.median(found.std[found.channel == i]) for i in found.channel])
    own = np.maximum(other.std(expected), floors)
    assert std[~torque] == pytest.approx(own[~torque], rel=1e-12)
    fixed = replace(found, noise=(None,) * 3, std=np.where(torque, found.std, 0.5))
    fixed.std[torque.argmax()] = 1e-9
    kept = fixed.with_noise_at(expected).std
    assert (kept[~torque] == 0.5).all()
    assert kept[torque.argmax()] == pytest.approx(1e-3 * np.median(fixed.std[torque]))


def test_a_channel_of_unknown_noise_is_left_out_with_a_note():
    found = stack_readings(case_of(), driven(case_of()))
    assert found.with_known_noise() == (found, [])
    unknown = replace(found, std=np.where(found.channel == 1, np.nan, found.std))
    kept, (note,) = unknown.with_known_noise()
    assert kept.channels == (found.channels[0], found.channels[2])
    assert kept.noise == (found.noise[0], found.noise[2])
    assert set(kept.channel[:32]) == {0} and set(kept.channel[32:]) == {1}
    assert kept.measured.tolist() == found.measured[found.channel != 1].tolist()
    assert note.code == "unused-channel"
    assert note.text.startswith("drawbar_pull_N is excluded: its noise is not declared")
    nothing = replace(found, std=np.full(len(found), np.nan))
    assert nothing.with_known_noise() == (nothing, [])


def test_readings_of_some_rows_are_numbered_anew():
    found = stacked()
    rows = np.asarray([4, 1])
    at = replace(found.at, slip=np.asarray(found.at.slip)[rows], load=np.asarray([80.0, 50.0]))
    selected, part = found.of_rows(rows, at)
    assert np.flatnonzero(selected).tolist() == [1, 3, 5]
    assert part.measured.tolist() == [2.0, 5.0, 0.02] and part.row.tolist() == [1, 0, 1]
    assert part.load.tolist() == [50.0, 80.0, 50.0] and part.run.tolist() == [0, 0]
    assert part.order.tolist() == [1, 2] and part.slip_std.tolist() == [0.05, 0.02]


@pytest.mark.parametrize("more, every", [(0, None), (1, 2), (MOST_READINGS, 2)])
def test_more_readings_than_fit_are_refused_with_what_to_leave_out(more, every):
    n = MOST_READINGS + more
    table = Table({"torque_Nm": np.ones(n), "sinkage_m": np.full(n, np.nan)}, source="runs.csv")
    if every is None:
        _check_size(table)
        return
    with pytest.raises(InputError, match=f"^runs.csv: {n} readings in {n} rows.* of {every}$"):
        _check_size(table)


def test_noise_in_the_model_is_that_of_the_readings():
    """Where a table declares none, each reading has the noise of its model file."""
    assert "2 %" not in MODEL
    case = case_of()
    found = stack_readings(case, driven(case))
    for i, name in enumerate(("torque_Nm", "drawbar_pull_N", "sinkage_m")):
        here = found.channel == i
        assert found.std[here] == pytest.approx(case.noise[name].std(found.measured[here]))
