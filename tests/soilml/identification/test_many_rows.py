"""Tables of many rows: near replicates become one, with the same answer."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import THREE_CHANNEL_MODEL
from gap_sets import case_of
from measured_rows import measured, two_gears
from remarked import remarked

from soilml import identification, identify
from soilml.config.measurement_noise import Noise
from soilml.errors import FitError
from soilml.experiment_design import samples_of_rows
from soilml.fitting.coordinates import select_free
from soilml.fitting.usable_readings import usable_readings
from soilml.identification import condensing as condensing_rows
from soilml.io.table import Table

ROWS = 2400


@pytest.fixture
def case():
    return case_of(THREE_CHANNEL_MODEL)


@pytest.fixture
def condensing(monkeypatch):
    """Tables are condensed from a thousand rows on, into few."""
    monkeypatch.setattr(condensing_rows, "MOST_ROWS", 1000)
    monkeypatch.setattr(condensing_rows, "CELLS", 400)
    monkeypatch.setattr(condensing_rows, "FIRST_ROWS", 300)


def both(monkeypatch, case, table, **options):
    """The fit of condensed rows, and that of all, by least squares unless another is asked for."""
    options = {"method": "nonlinear"} | options
    condensed = identify(case, table, **options)
    monkeypatch.setattr(condensing_rows, "MOST_ROWS", len(table))
    return condensed, identify(case, table, **options)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["plain", "gears", "gaps", "undeclared", "slip noise"])
def test_least_squares_of_condensed_rows_are_those_of_all(case, condensing, monkeypatch, kind):
    rng, gear = np.random.default_rng(11), None
    if kind == "gears":
        case, gear = two_gears(case), np.asarray(["narrow", "wide"] * (ROWS // 2))
    table = measured(case, rng, ROWS, gear=gear, least_slip=0.05)
    if kind == "gaps":
        blank = rng.random(ROWS) < 0.5
        columns = {name: table[name] for name in table.columns}
        table = Table(columns | {"sinkage_m": np.where(blank, np.nan, table["sinkage_m"])})
    if kind == "undeclared":
        case = replace(case, noise={})
    if kind == "slip noise":
        case = replace(case, noise=case.noise | {"slip": Noise(constant=0.005)})
    few, all_rows = both(monkeypatch, case, table)
    assert np.abs(few.values - all_rows.values).max() > 0.0  # not the same computation
    assert np.abs((few.values - all_rows.values) / all_rows.std).max() < 0.05
    assert few.std == pytest.approx(all_rows.std, rel=0.02)
    assert few.misfit == pytest.approx(all_rows.misfit, rel=0.02)
    assert few.warnings == all_rows.warnings
    assert few.rows_used == ROWS


@pytest.mark.slow
def test_rows_of_very_different_weight_are_not_one(case, condensing, monkeypatch):
    # a relative noise is small where the torque changes its sign, at little slip
    table = measured(case, np.random.default_rng(11), ROWS, least_slip=-0.05)
    few, all_rows = both(monkeypatch, case, table)
    assert few.std == pytest.approx(all_rows.std, rel=0.02)
    assert np.abs((few.values - all_rows.values) / all_rows.std).max() < 0.3


@pytest.mark.slow
def test_the_posterior_of_condensed_rows_is_that_of_least_squares(case, condensing):
    table = measured(case, np.random.default_rng(12), ROWS)
    sampled, fit = (
        identify(case, table, method="posterior"),
        identify(case, table, method="nonlinear"),
    )
    assert np.abs((sampled.values - fit.values) / fit.std).max() < 0.15
    assert sampled.std == pytest.approx(fit.std, rel=0.1)
    assert sampled.misfit == pytest.approx(fit.misfit, rel=1e-3)
    assert sampled.rows_used == ROWS


def test_residuals_within_the_cells_count_as_misfit(case, condensing):
    table = measured(case, np.random.default_rng(13), ROWS)
    louder = table["torque_Nm"] * (1.0 + 0.06 * np.random.default_rng(14).standard_normal(ROWS))
    columns = {name: table[name] for name in ("slip", "load_N")} | {"torque_Nm": louder}
    fit = identify(case, Table(columns), method="nonlinear")
    assert fit.misfit == pytest.approx((0.06**2 + 0.02**2) / 0.02**2, rel=0.1)
    assert remarked(fit.warnings, "times the declared noise")


def test_closed_forms_refuse_more_rows_than_they_hold(case, monkeypatch):
    monkeypatch.setattr(identification, "MOST_ROWS", 19)
    table = measured(case, np.random.default_rng(18), 20)
    for method in identification.CLOSED_FORM:
        with pytest.raises(FitError, match=r"20 rows in one fit; .* at most 19: take nonlinear"):
            identify(case, table, method=method)


@pytest.mark.long
def test_advice_rests_on_condensed_rows(case, condensing, monkeypatch):
    """Samples of soil of the same mean and spread as those of all rows."""
    data = usable_readings(case, measured(case, np.random.default_rng(4), ROWS))
    free, found = select_free(case, None), {}
    for name in ("condensed", "all"):
        samples = samples_of_rows(case, data, free)
        value = np.stack([f.prior.at(samples.u[:, i]) for i, f in enumerate(free)], axis=1)
        found[name] = samples.remaining_fraction, samples.weights @ value
        monkeypatch.setattr(condensing_rows, "MOST_ROWS", ROWS)
    (left, mean), (all_left, all_mean) = found.values()
    assert not np.array_equal(mean, all_mean)  # not the same computation
    np.testing.assert_allclose(left, all_left, rtol=0.2)
    std = all_left * np.asarray([f.prior.std for f in free])
    assert np.abs((mean - all_mean) / std).max() < 0.3
