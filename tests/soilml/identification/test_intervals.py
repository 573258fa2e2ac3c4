"""Intervals of a fit know the ranges of the priors."""

import numpy as np

from soilml import Operating, identify, read_case
from soilml.io.table import Table


def test_intervals_end_where_the_prior_ends(model_file):
    """Two rows of one load leave all open: a Gaussian would reach below a cohesion of zero."""
    case = read_case(model_file)
    slip, load = np.array([0.1, 0.2]), np.full(2, 40.0)
    torque = case.model(case.soil, Operating(slip=slip, load=load)).torque
    rows = Table({"run": np.full(2, "a"), "slip": slip, "load_N": load, "torque_Nm": torque})
    fit = identify(case, rows, method="nonlinear")
    gaussian = fit.values - 1.645 * fit.std
    low, high = fit.interval
    lower, upper = np.array([[case.prior[n].lower, case.prior[n].upper] for n in fit.names]).T
    assert (gaussian < lower).any()
    assert (low >= lower).all() and (high <= upper).all() and (low < high).all()
    inside = gaussian > lower
    np.testing.assert_allclose(low[inside], gaussian[inside], rtol=1e-3)
