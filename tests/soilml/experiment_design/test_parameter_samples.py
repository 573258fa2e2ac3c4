"""Parameter samples: of a prior, of a posterior, and from moments."""

import numpy as np
import pytest

from soilml import Operating, identify, read_case
from soilml.experiment_design import samples_of_moments, samples_of_prior, samples_of_rows
from soilml.fitting.coordinates import select_free
from soilml.fitting.usable_readings import usable_readings
from soilml.io.table import Table
from soilml.numerics.maximum_entropy import prior_quantiles
from soilml.numerics.prior import Prior

PROBABILITY = (np.arange(4000) + 0.5) / 4000


def rows(case, slip, load):
    force = case.model(case.soil, Operating(slip=slip, load=load))
    run = np.full(len(slip), "a")
    return Table({"run": run, "slip": slip, "load_N": load, "torque_Nm": force.torque})


def test_samples_of_the_prior_have_its_width(model_file):
    np.testing.assert_allclose(
        samples_of_prior(select_free(read_case(model_file), None)).remaining_fraction,
        1.0,
        rtol=1e-3,
    )


@pytest.mark.parametrize(("mean", "std"), [(0.5, 0.1), (0.05, 0.04), (0.9, 0.2), (0.4, 0.01)])
def test_a_parameter_has_the_mean_and_std_requested_and_stays_inside(mean, std):
    prior = Prior(0.0, 1.0)
    value = prior.at(prior_quantiles(prior, mean, std, PROBABILITY))
    assert value.mean() == pytest.approx(mean, abs=0.02 * std + 2e-4)
    assert value.std() == pytest.approx(std, rel=0.03)
    assert value.min() >= 0.0 and value.max() <= 1.0


@pytest.mark.slow
def test_samples_of_rows_are_as_wide_and_as_correlated_as_the_posterior(model_file):
    case = read_case(model_file)
    table = rows(case, np.asarray([0.1, 0.5, 0.5]), np.asarray([60.0, 60.0, 110.0]))
    free = select_free(case, None)
    fit = identify(case, table, None, "posterior")
    posterior = samples_of_rows(case, usable_readings(case, table), free, exact_model=True)
    from_moments = samples_of_moments(free, fit.names, fit.values, fit.covariance)
    for found in (posterior, from_moments):
        np.testing.assert_allclose(
            found.remaining_fraction, list(fit.remaining_fraction.values()), rtol=0.06
        )
        spread = (found.standardised.T * found.weights) @ found.standardised
        correlation = spread / np.outer(found.remaining_fraction, found.remaining_fraction)
        np.testing.assert_allclose(correlation, fit.correlation, atol=0.08)


@pytest.mark.slow
def test_excess_residuals_scale_the_noise(model_file):
    case = read_case(model_file)
    table = rows(case, np.full(4, 0.3), np.full(4, 60.0))
    shaken = dict(table.columns) | {"torque_Nm": table["torque_Nm"] * np.tile([0.9, 1.1], 2)}
    free = select_free(case, None)
    assert samples_of_rows(case, usable_readings(case, table), free).noise_scale == 1.0
    assert samples_of_rows(case, usable_readings(case, Table(shaken)), free).noise_scale > 3.0
