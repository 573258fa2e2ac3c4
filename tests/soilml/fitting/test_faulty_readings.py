"""Readings that a sensor or logger spoilt are found, said and left out before any analysis."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from soilml import Table, gap, identify, read_case, simulate
from soilml.errors import TableError

SLIP, LOAD = np.tile(np.linspace(0.08, 0.5, 8), 4), np.repeat([45.0, 80.0, 45.0, 110.0], 8)
RUN = np.repeat([1, 2, 3, 4], 8)


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    """Three noisy channels of a wheel on sand."""
    from conftest import THREE_CHANNEL_MODEL

    file = tmp_path_factory.mktemp("faults") / "model.toml"
    file.write_text(THREE_CHANNEL_MODEL)
    return read_case(file)


def driven(case, seed=0):
    """A campaign without any fault, with the times of its rows."""
    table = simulate(case, SLIP, LOAD, run=RUN, seed=seed)
    return replace(table, columns=table.columns | {"time_s": np.arange(32.0) * 300.0})


def changed(table, **columns):
    return replace(table, columns=table.columns | columns)


def codes(fit):
    return {remark.code for remark in fit.warnings}


def values_of(fit):
    return np.asarray([*fit.values, *fit.std])


def test_rows_that_are_logged_twice_count_once(case):
    once = driven(case)
    twice = once.rows(np.repeat(np.arange(32), 2))
    twice = changed(twice, time_s=twice["time_s"] + np.tile([0.0, 1.0], 32))
    fit, of_once = identify(case, twice), identify(case, once)
    assert "duplicate-rows" in codes(fit)
    np.testing.assert_array_equal(values_of(fit), values_of(of_once))
    verdict = gap(case, twice)
    assert "32 rows repeat" in next(n.text for n in verdict.notes if n.code == "duplicate-rows")
    assert verdict.status == gap(case, once).status == "no-gap"


def test_a_torque_that_is_clipped_is_left_out_and_suspects_no_effect(case):
    table = driven(case)
    limit = np.sort(table["torque_Nm"])[-8]
    clipped = changed(table, torque_Nm=np.minimum(table["torque_Nm"], limit))
    report = gap(case, clipped)
    (remark,) = [n for n in report.notes if n.code == "clipped-readings"]
    assert remark.about == ("torque_Nm",)
    assert "8 readings are left out" in remark.text and f"{limit:.6g}" in remark.text
    assert report.status == "no-gap" and not report.effects
    without = np.where(table["torque_Nm"] >= limit, np.nan, table["torque_Nm"])
    fits = [
        identify(case, changed(table, torque_Nm=own)) for own in (clipped["torque_Nm"], without)
    ]
    np.testing.assert_array_equal(values_of(fits[0]), values_of(fits[1]))


def test_a_torque_that_is_clipped_in_one_run_is_left_out_of_that_run(case):
    table = driven(case)
    order = np.random.default_rng(3).permutation(32)
    torque = table["torque_Nm"].copy()
    torque[8:16] = np.minimum(torque[8:16], np.sort(torque[8:16])[-4])
    assert torque.max() > torque[8:16].max()
    fit = identify(case, changed(table, torque_Nm=torque).rows(order))
    (remark,) = [n for n in fit.warnings if n.code in ("clipped-readings", "held-readings")]
    assert "4 readings are left out" in remark.text and "clips or holds" in remark.text
    assert f"{torque[8:16].max():.6g}" in remark.text and remark.severity == "warning"


def test_a_reading_that_a_logger_held_is_left_out_with_its_rows(case):
    table = driven(case)
    torque = table["torque_Nm"].copy()
    torque[3:6] = torque[2]
    fit = identify(case, changed(table, torque_Nm=torque))
    (remark,) = [n for n in fit.warnings if n.code == "held-readings"]
    assert "3 readings are left out (rows 4, 5, 6)" in remark.text


def test_coarse_steps_are_noise(case):
    table = driven(case)
    coarse = changed(table, torque_Nm=np.round(table["torque_Nm"] / 0.8) * 0.8)
    fit = identify(case, coarse)
    assert "coarse-steps" in codes(fit) and "held-readings" not in codes(fit)
    angle = fit.names.index("friction_angle")
    assert fit.std[angle] > identify(case, table).std[angle]
    assert abs(fit.values[angle] - case.soil.friction_angle) < 3.0 * fit.std[angle]


def test_a_column_that_is_a_copy_of_another_is_refused(case):
    table = driven(case)
    with pytest.raises(TableError, match=r"torque_Nm and drawbar_pull_N are the same .* 32 of 32"):
        identify(case, changed(table, drawbar_pull_N=table["torque_Nm"]))


@pytest.mark.parametrize("digits", [2, 3, 4, 12])
def test_sound_rows_of_any_resolution_are_all_used(case, digits):
    for seed in range(20):
        table = driven(case, seed)
        names = ("torque_Nm", "drawbar_pull_N")
        rounded = changed(table, **{n: np.round(table[n], digits) for n in names})
        from soilml.fitting.faulty_readings import sound_rows

        found, remarks = sound_rows(case, rounded)
        assert remarks == [] and found is rounded


def test_equal_rows_of_a_coarse_sensor_are_repeats(case):
    table = driven(case)
    coarse = {n: np.round(table[n], 0) for n in ("torque_Nm", "drawbar_pull_N")}
    columns = {n: table[n] for n in ("run", "slip", "load_N")} | coarse
    again = {n: np.repeat(values, 2) for n, values in columns.items()}
    assert "duplicate-rows" not in codes(identify(case, Table(again)))
