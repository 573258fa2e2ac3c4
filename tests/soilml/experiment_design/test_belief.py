"""Samples of what is believed: of a prior, of rows, of an estimate's moments."""

import numpy as np
import pytest

from soilml import Operating, identify, read_case
from soilml.experiment_design import samples_of_moments, samples_of_prior, samples_of_rows
from soilml.identification.free_parameters import FreeParameter, select_free
from soilml.identification.observations import read_observations
from soilml.io.table import Table
from soilml.numerics.maximum_entropy import prior_quantiles
from soilml.numerics.prior import Prior

BELOW = (np.arange(4000) + 0.5) / 4000


def rows(case, slip, load):
    force = case.model(case.soil, Operating(slip=slip, load=load))
    run = np.full(len(slip), "a")
    return Table({"run": run, "slip": slip, "load_N": load, "torque_Nm": force.torque})


def test_the_prior_is_as_wide_as_itself(model_file):
    np.testing.assert_allclose(
        samples_of_prior(select_free(read_case(model_file), None)).left, 1.0, rtol=1e-3
    )


@pytest.mark.parametrize("prior", [Prior(0.0, 3000.0), Prior(1e6, 1e8, log=True)])
def test_moments_of_the_prior_give_the_prior_back(prior):
    value = prior.at(BELOW)
    found = prior_quantiles(prior, float(value.mean()), float(value.std()), BELOW)
    np.testing.assert_allclose(found, BELOW, atol=2e-3)


@pytest.mark.parametrize(("mean", "std"), [(0.5, 0.1), (0.05, 0.04), (0.9, 0.2), (0.4, 0.01)])
def test_a_parameter_has_the_mean_and_std_that_it_was_told_and_stays_inside(mean, std):
    prior = Prior(0.0, 1.0)
    value = prior.at(prior_quantiles(prior, mean, std, BELOW))
    assert value.mean() == pytest.approx(mean, abs=0.02 * std + 2e-4)
    assert value.std() == pytest.approx(std, rel=0.03)
    assert value.min() >= 0.0 and value.max() <= 1.0


def test_moments_that_no_density_has_give_fractions_of_the_prior_all_the_same():
    prior = Prior(0.0, 1.0)
    for mean, std in ((0.0, 0.3), (1.0, 0.3), (0.5, 0.7), (0.3, 0.0), (2.0, 0.1)):
        found = prior_quantiles(prior, mean, std, BELOW)
        assert np.isfinite(found).all() and found.min() >= 0.0 and found.max() <= 1.0


def test_samples_of_rows_are_as_wide_and_as_correlated_as_the_posterior(model_file):
    case = read_case(model_file)
    table = rows(case, np.asarray([0.1, 0.5, 0.5]), np.asarray([60.0, 60.0, 110.0]))
    free = select_free(case, None)
    fit = identify(case, table, None, "posterior")
    belief = samples_of_rows(case, read_observations(case, table), free)
    told = samples_of_moments(free, fit.names, fit.values, fit.covariance)
    for found in (belief, told):
        np.testing.assert_allclose(found.left, list(fit.left.values()), rtol=0.06)
        spread = (found.shares.T * found.weights) @ found.shares
        correlation = spread / np.outer(found.left, found.left)
        np.testing.assert_allclose(correlation, fit.correlation, atol=0.08)


def test_rows_that_scatter_more_than_declared_will_again(model_file):
    case = read_case(model_file)
    table = rows(case, np.full(4, 0.3), np.full(4, 60.0))
    shaken = dict(table.columns) | {"torque_Nm": table["torque_Nm"] * np.tile([0.9, 1.1], 2)}
    free = select_free(case, None)
    assert samples_of_rows(case, read_observations(case, table), free).larger == 1.0
    assert samples_of_rows(case, read_observations(case, Table(shaken)), free).larger > 3.0


def test_a_parameter_that_an_estimate_does_not_name_stays_as_its_prior(model_file):
    free = [
        *select_free(read_case(model_file), None),
        FreeParameter("kphi", "N/m^(n+2)", Prior(1e5, 1e7, log=True), 1e6, False),
    ]
    told = samples_of_moments(free, ("cohesion",), np.asarray([600.0]), np.asarray([[100.0**2]]))
    assert told.left[0] == pytest.approx(100.0 * 12**0.5 / 3000.0, rel=0.05)
    np.testing.assert_allclose(told.left[1:], 1.0, rtol=0.01)
