"""Readings of all channels in one vector: noise, order, parts and the largest size."""

from dataclasses import replace

import numpy as np
import pytest
from gap_sets import case_of, driven

from soilml.errors import InputError
from soilml.fitting.readings import stack_readings, typical_std
from soilml.gap.workflow import MOST_READINGS, _check_size
from soilml.io.table import Table

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


def test_a_table_without_a_reading_has_none():
    table = Table({name: SMALL[name] for name in ("run", "slip", "load_N")})
    found = stacked(table)
    assert (len(found), found.channels) == (0, ())
    assert found.row.size == found.channel.size == found.std.size == 0
    assert found.slip_std.tolist() == found.load_std.tolist() == [0.0] * 5


def test_noise_that_is_not_positive_is_the_median_of_the_others():
    found = stacked()
    assert found.std[:4] == pytest.approx([0.1, 0.3, 0.3, 0.5])
    assert [note.code for note in found.notes] == ["zero-noise"]
    none = stacked(replace(SMALL, columns=SMALL.columns | {"torque_Nm_std": np.zeros(5)}))
    assert none.undeclared == ("torque_Nm",) and not none.notes
    noise = case_of().noise
    assert found.std[4:] == pytest.approx(noise["sinkage_m"].std(found.measured[4:]))
    assert found.share.tolist() == [0.0] * 4 + [noise["sinkage_m"].share] * 4  # torque: table
    assert found.slip_std.tolist() == [0.01, 0.02, 0.0, 0.03, 0.05]
    assert typical_std(found.slip_std) == pytest.approx(0.025)  # the median of those above zero
    assert not found.load_std.any() and typical_std(found.load_std) == 0.0
    elsewhere = found.noise_at(2.0 * found.measured)
    assert elsewhere[:4] == pytest.approx(found.std[:4], nan_ok=True)
    assert elsewhere[4:] == pytest.approx(noise["sinkage_m"].std(2.0 * found.measured[4:]))
    usual = none.with_default_std({"torque": 0.7})
    assert usual.std[:4] == pytest.approx([0.7, 0.7, 0.7, 0.7])
    assert usual.std[4:].tolist() == found.std[4:].tolist()


def test_noise_is_that_of_expected_values_and_never_nothing():
    case = case_of()
    found = stack_readings(case, driven(case))
    noise = case.noise["torque_Nm"]
    torque = found.channel == found.channels.index("torque")
    expected = 2.0 * found.measured
    expected[0] = 0.0
    other = replace(noise, share=3.0 * noise.share)
    share = np.where(torque, noise.share, other.share)
    std = replace(found, share=share, constant=0.0 * share).with_noise_at(expected).std
    floor = 1e-3 * np.median(found.std[torque])
    own = np.maximum(noise.std(expected[torque]), floor)
    assert std[torque] == pytest.approx(own, rel=1e-12) and std[torque].min() > 0.0
    by = other.std(found.measured)
    floors = np.asarray([1e-3 * np.median(by[found.channel == i]) for i in found.channel])
    own = np.maximum(other.std(expected), floors)
    assert std[~torque] == pytest.approx(own[~torque], rel=1e-12)
    fixed = replace(found, constant=np.where(torque, found.std, 0.5), share=0.0 * share)
    fixed.constant[torque.argmax()] = 1e-9
    kept = fixed.with_noise_at(expected).std
    assert (kept[~torque] == 0.5).all()
    assert kept[torque.argmax()] == pytest.approx(1e-3 * np.median(fixed.constant[torque]))


def test_a_channel_of_unknown_noise_is_left_out_with_a_note():
    found = stack_readings(case_of(), driven(case_of()))
    assert found.with_known_noise() is found
    unknown = replace(found, std=np.where(found.channel == 1, np.nan, found.std))
    kept = unknown.with_known_noise()
    (note,) = kept.notes
    assert kept.channels == (found.channels[0], found.channels[2])
    assert set(kept.channel[:32]) == {0} and set(kept.channel[32:]) == {1}
    assert kept.measured.tolist() == found.measured[found.channel != 1].tolist()
    assert note.code == "unused-channel"
    assert note.text.startswith("drawbar_pull_N is not used: its noise is not declared")
    nothing = replace(found, std=np.full(len(found), np.nan))
    assert nothing.with_known_noise() is nothing


@pytest.mark.parametrize("more, every", [(0, None), (1, 2), (MOST_READINGS, 2)])
def test_more_readings_than_fit_are_refused_with_what_to_leave_out(more, every):
    n = MOST_READINGS + more
    table = Table({"torque_Nm": np.ones(n), "sinkage_m": np.full(n, np.nan)}, source="runs.csv")
    if every is None:
        _check_size(table)
        return
    with pytest.raises(InputError, match=f"^runs.csv: {n} readings in {n} rows.* of {every}$"):
        _check_size(table)
