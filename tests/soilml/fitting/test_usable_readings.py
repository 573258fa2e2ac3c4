"""What identification takes from a table: noise, and rows that count."""

from dataclasses import replace

import numpy as np
import pytest
from measured_rows import torque_rows

from soilml import Noise, gap, identify, simulate
from soilml.errors import FitError, InputError, TableError
from soilml.fitting.usable_readings import usable_readings
from soilml.io.table import Table
from soilml.remarks import about, texts

SHEAR = ["friction_angle", "shear_modulus"]


@pytest.fixture
def table(case):
    slip, load = np.linspace(0.05, 0.55, 12), np.tile([40.0, 70.0, 100.0], 4)
    return replace(torque_rows(case, {}, slip, load), source="log.csv", line=np.arange(2, 14))


def changed(table, **columns):
    return Table(table.columns | columns, table.source, table.line)


def test_noise_of_slip_and_load_is_read_from_their_own_columns(case, table):
    plain = identify(case, table, SHEAR, method="nonlinear")
    std = np.full(12, 0.05)
    std[0] = np.nan
    shaky = changed(table, slip_std=std, load_N_std=0.2 * table["load_N"])
    data = usable_readings(case, shaky)
    assert data.slip_std.tolist() == [0.0, *[0.05] * 11]
    assert (data.load_std > 0).all()
    assert (identify(case, shaky, SHEAR, method="nonlinear").std > 1.5 * plain.std).all()
    huge = changed(table, load_N_std=np.full(12, 1e300), slip_std=np.full(12, 1e300))
    assert np.isfinite(identify(case, huge, SHEAR, method="nonlinear").std).all()


@pytest.mark.slow
@pytest.mark.parametrize("method", ["nonlinear", "newton"])
def test_a_reading_of_zero_with_relative_noise_has_finite_weight(case, table, method):
    truth = identify(case, table, SHEAR, method)
    torque = table["torque_Nm"].copy()
    torque[4] = 0.0
    fit = identify(case, changed(table, torque_Nm=torque), SHEAR, method)
    said = " ".join(texts(fit.warnings))
    assert (
        "log.csv line 6, column torque_Nm: standard deviation 0 replaced by the column's median"
        in said
    )
    assert "not declared" not in said
    assert np.isfinite(fit.std).all() and (fit.std > truth.std).all()


def test_a_standard_deviation_of_almost_zero_is_replaced(case, table):
    std = np.full(12, 0.05)
    std[[2, 5]] = 1e-300
    fit = identify(case, changed(table, torque_Nm_std=std), SHEAR, method="nonlinear")
    assert (
        "line 4, column torque_Nm: standard deviation 1e-300 replaced by the column's median 0.05; "
        "1 more rows likewise" in (" ".join(texts(fit.warnings)))
    )
    np.testing.assert_allclose(
        fit.std,
        identify(
            case, changed(table, torque_Nm_std=np.full(12, 0.05)), SHEAR, method="nonlinear"
        ).std,
    )
    for bad in (
        changed(table, torque_Nm_std=np.full(12, 1e-300)),
        changed(table, torque_Nm=np.zeros(12)),
    ):
        with pytest.raises(FitError, match="line 2, column torque_Nm: standard deviation"):
            identify(case, bad, SHEAR, method="nonlinear")


def test_rows_whose_status_is_not_ok_are_excluded_and_counted(case, table):
    torque, status = table["torque_Nm"].copy(), np.full(12, "ok", dtype="<U20")
    torque[[3, 7]], status[[3, 7]], status[0] = 99.0, "no equilibrium", ""
    fit = identify(case, changed(table, torque_Nm=torque, status=status), SHEAR, method="nonlinear")
    assert fit.rows_used == 10
    assert fit["friction_angle"] == pytest.approx(float(case.soil.friction_angle), rel=1e-4)
    assert "2 rows are excluded: the status is not ok" in texts(fit.warnings)
    with pytest.raises(InputError, match=r"log\.csv: no row has the status ok"):
        identify(case, changed(table, status=np.full(12, "no peak")), SHEAR, method="nonlinear")


def test_rows_cannot_be_grouped_by_blank_cells(table):
    time = np.arange(12.0)
    time[5] = np.nan
    with pytest.raises(TableError, match=r"log\.csv line 7, column time_s: the cell is blank"):
        list(changed(table, time_s=time).groups("time_s"))


def test_a_relative_noise_is_the_median_one_at_a_reading_of_zero_for_gap_too(case):
    slip, load = np.tile(np.linspace(0.05, 0.6, 8), 3), np.repeat([40.0, 60.0, 90.0], 8)
    known = replace(case, noise={"torque_Nm": Noise(share=0.02), "sinkage_m": Noise(share=0.02)})
    rows = simulate(known, slip, load, run=load, seed=3)
    sinkage = rows["sinkage_m"].copy()
    sinkage[5] = 0.0
    rows = replace(rows, columns=rows.columns | {"sinkage_m": sinkage})
    report = gap(known, rows)
    (note,) = [remark for remark in report.notes if remark.code == "zero-noise"]
    assert note.about == ("sinkage_m",) and "row 6" in note.text
    assert about(report.notes, "unused-channel") == {"drawbar_pull_N"}  # its noise is not declared


def test_the_order_of_the_rows_is_read_where_it_is_known(case, table):
    """Drifts of the soil and hysteresis can be explanations of rows whose case has neither."""
    order = np.random.default_rng(2).permutation(24) % 12
    mixed = Table({name: values[order] for name, values in table.columns.items()})
    mixed.columns["torque_Nm"] *= 1.0 + 1e-3 * np.arange(24)  # rows that repeat are copies
    at = usable_readings(case, mixed).at
    np.testing.assert_allclose(at.progress, np.linspace(0.0, 1.0, 24))
    assert set(at.load_direction) == {-1.0, 1.0}
    assert usable_readings(case, table).at.progress is None  # it rises with slip alone
