"""Parameter samples: of a prior, of a posterior, and from moments."""

import numpy as np
import pytest
from measured_rows import torque_rows

from soilml import identify, read_case
from soilml.experiment_design import samples_of_moments, samples_of_rows
from soilml.fitting.coordinates import select_free
from soilml.fitting.usable_readings import usable_readings


@pytest.mark.slow
def test_samples_of_rows_are_as_wide_and_as_correlated_as_the_posterior(model_file):
    case = read_case(model_file)
    table = torque_rows(case, {}, np.asarray([0.1, 0.5, 0.5]), np.asarray([60.0, 60.0, 110.0]))
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
