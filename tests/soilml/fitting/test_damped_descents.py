"""Steps of a bounded fit: bounds, and curved valleys."""

import numpy as np
import pytest
from gap_sets import MODEL, case_of, driven

from soilml.fitting.coordinates import select_free
from soilml.fitting.damped_descents import EXACT, bounded_step, descend
from soilml.fitting.least_squares import LeastSquaresProblem
from soilml.fitting.readings import stack_readings


def of_soil(case, table):
    """The soil alone, fitted to these rows under their declared noise."""
    readings = stack_readings(case, table)
    whiten = np.diag(1.0 / readings.std)
    return LeastSquaresProblem(case, tuple(select_free(case, None)), readings, whiten)


def test_a_fit_follows_the_valley_of_bearing_modulus_and_exponent():
    """Modulus and exponent of pressure-sinkage compensate each other at the usual sinkage."""
    bearing = "kphi = [100000.0, 5000000.0]\nn = [0.4, 1.6]\n[noise]"
    case = case_of(MODEL.replace("[noise]", bearing))
    own = of_soil(case, driven(case, seed=1))
    truth = [c.prior.fraction(float(getattr(case.soil, c.path))) for c in own.coordinates]
    best = descend(own, np.asarray(truth))
    near = np.full(5, 0.5), np.asarray([0.5, 0.5, 0.3, 0.06, 0.2])
    for start in (*near, *np.random.default_rng(0).random((8, 5))):
        found = descend(own, start, EXACT)
        assert found.converged
        assert found.objective == pytest.approx(best.objective, abs=0.02)


def test_a_step_that_meets_a_bound_goes_on_in_the_valley():
    """Along the valley u = v the minimum lies at 5; where u ends at 1, v ends nearby."""
    normal = np.asarray([[1.0, -0.99], [-0.99, 1.0]])
    descent = normal @ np.asarray([5.0, 5.0])
    low, high = np.full(2, -1.0), ((1.0, 9.0), (0.0, 9.0), (9.0, 9.0))
    met, held, within = (bounded_step(normal, descent, low, np.asarray(h)) for h in high)
    assert met == pytest.approx([1.0, 5.0 - 0.99 * 4.0])
    assert held == pytest.approx([0.0, descent[1]])
    assert within == pytest.approx([5.0, 5.0])


def test_a_start_with_a_known_linearisation_leads_to_the_same_fit():
    own = of_soil(case_of(), driven(case_of(), seed=2))
    start = np.full(3, 0.3)
    known = own.linearised(start).linearisation
    alone, beside = descend(own, start), descend(own, start, near=known)
    elsewhere = descend(own, np.full(3, 0.6), near=known)
    assert np.array_equal(alone.x, beside.x) and alone.objective == beside.objective
    assert elsewhere.x == pytest.approx(alone.x, abs=2e-3)
