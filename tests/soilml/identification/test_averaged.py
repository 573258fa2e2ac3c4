"""The default answer of identify: the soil averaged over what the model may lack."""

from dataclasses import replace

import numpy as np
import pytest
from gap_sets import case_of, driven

from datagen.recipe import read_recipe
from soilml import Operating, Table, identify
from soilml.config.measurement_noise import Discrepancy
from soilml.gap import gap
from soilml.inference.search import Search
from soilml.physics.effects.soil_changes import FrictionDrift
from soilml.quantities import SHEAR

CASE = read_recipe("wheel").case
SLIP, LOAD = np.tile([0.1, 0.25, 0.4, 0.6], 3), np.repeat([40.0, 70.0, 100.0], 4)
COLUMNS = {"torque_Nm": "torque", "drawbar_pull_N": "drawbar_pull", "sinkage_m": "sinkage"}
TRUTH = np.asarray([1040.0, 0.55, 0.018])


def rows(columns=COLUMNS, seed=0, slip_offset=0.0, factor=1.0):
    """Rows of the truth, slip read too high by an offset, readings multiplied."""
    true = CASE.with_values(dict(zip(SHEAR, TRUTH, strict=True)))
    force = true.model(true.soil, Operating(slip=SLIP - slip_offset, load=LOAD))
    rng, found = np.random.default_rng(seed), {"slip": SLIP, "load_N": LOAD}
    for key, name in columns.items():
        y = factor * getattr(force, name)
        found[key] = y + CASE.noise[key].std(y) * rng.standard_normal(len(y))
    return Table(found)


def holds(fit, truth=TRUTH):
    return (fit.interval[0] <= truth) & (truth <= fit.interval[1])


@pytest.mark.slow
def test_the_average_holds_the_truth_where_a_sensor_is_wrong():
    fit = identify(CASE, rows(slip_offset=0.03))
    assert fit.method == "averaged" and holds(fit).all()
    assert sum(one.probability for one in fit.explanations) == pytest.approx(1.0)
    assert not holds(identify(CASE, rows(slip_offset=0.03), method="posterior")).all()
    assert fit.as_json()["explanations"][0]["text"] == str(fit.explanations[0])


@pytest.mark.slow
def test_the_average_is_little_wider_where_the_model_is_right():
    fit = identify(CASE, rows(seed=3))
    ratio = fit.std / identify(CASE, rows(seed=3), method="posterior").std
    assert fit.fits and holds(fit).all()
    assert (ratio > 1.0).all() and ratio.mean() < 3.5


@pytest.mark.parametrize("count", [1, 2, 5])
def test_a_few_rows_of_torque_leave_most_of_the_prior(count):
    table = rows({"torque_Nm": "torque"}).rows(np.arange(count) * 2)
    fit = identify(CASE, table)
    prior = [CASE.prior[name] for name in SHEAR]
    assert holds(fit).all() and max(fit.remaining_fraction.values()) > 0.5
    assert all(p.lower <= a and b <= p.upper for p, a, b in zip(prior, *fit.interval, strict=True))


@pytest.mark.slow
def test_a_drift_of_the_soil_is_an_explanation_where_the_order_of_the_rows_is_known():
    order = np.random.default_rng(6).permutation(2 * len(SLIP)) % len(SLIP)
    table = rows()
    columns = {name: values[order] for name, values in table.columns.items()}
    case = CASE.with_values(dict(zip(SHEAR, TRUTH, strict=True)))
    at = Operating(slip=SLIP[order], load=LOAD[order], progress=np.linspace(0.0, 1.0, len(order)))
    drifting = (case.model + FrictionDrift(gain=0.2))(case.soil, at)
    columns |= {key: np.asarray(getattr(drifting, name)) for key, name in COLUMNS.items()}
    assert "friction-drift" in identify(CASE, Table(columns)).explanations[0].effects


@pytest.mark.slow
def test_rows_that_nothing_explains_are_said_to_be_so():
    rng = np.random.default_rng(1)
    fit = identify(CASE, rows(factor=rng.uniform(0.3, 1.7, len(SLIP))))
    assert not fit.fits and fit.verdict.startswith("The model does not fit these rows (")


@pytest.mark.slow
def test_a_declared_discrepancy_is_in_the_intervals():
    table = rows({"torque_Nm": "torque"})
    case = replace(CASE, discrepancy={"torque_Nm": Discrepancy(share=0.05)})
    stated, plain = (identify(own, table, method="averaged") for own in (case, CASE))
    assert holds(stated).all() and (stated.std > plain.std).all()


@pytest.mark.slow
def test_noise_that_is_not_declared_is_that_of_the_residuals():
    fit = identify(replace(CASE, noise={}), rows({"torque_Nm": "torque"}))
    assert fit.method == "averaged" and holds(fit).all()
    assert "undeclared-noise" in {remark.code for remark in fit.warnings}


@pytest.mark.slow
def test_identify_and_gap_of_the_same_rows_compute_one_posterior(monkeypatch):
    searched, run = [], Search.run

    def counted(search):
        searched.append(search)
        return run(search)

    monkeypatch.setattr(Search, "run", counted)
    table = rows(seed=5)
    identify(CASE, table)
    gap(CASE, table)
    assert len(searched) == 1


def test_scatter_of_the_soil_from_run_to_run_is_no_misfit():
    """Residuals of twice the noise or more, which another soil in each run explains."""
    case = case_of()
    factors = np.exp(0.05 * np.random.default_rng(101).standard_normal(6))
    loads, soils = (40.0, 60.0, 90.0, 140.0, 50.0, 75.0), {"kphi": case.soil.kphi * factors}
    fit = identify(case, driven(case, loads=loads, soils=soils, seed=1))
    assert fit.misfit > 4.0 and fit.fits


def test_noise_far_above_the_declared_one_is_a_misfit_though_it_is_no_gap():
    case = case_of()
    table = driven(case, noise=3.0, seed=1)
    fit = identify(case, table)
    assert not fit.fits and fit.misfit > 4.0
    assert gap(case, table).status == "undecided"
