"""Which row to drive next: physics says where the information is."""

import numpy as np
import pytest
from measured_rows import torque_rows

from soilml import identify
from soilml.errors import FitError
from soilml.experiment_design.design import candidate_grid, rate_rows
from soilml.experiment_design.parameter_samples import samples_of_prior, samples_of_rows
from soilml.fitting.coordinates import select_free
from soilml.fitting.usable_readings import usable_readings
from soilml.quantities import NOT_IDENTIFIED_ABOVE

SOIL = {"cohesion": 900.0, "friction_angle": 0.6, "shear_modulus": 0.012}
GRID = candidate_grid([0.05, 0.2, 0.6], [30.0, 60.0, 120.0])


def after(case, slip, load, **options):
    """Advice after rows driven so on SOIL without noise."""
    data = usable_readings(case, torque_rows(case, SOIL, slip, load))
    samples = samples_of_rows(case, data, select_free(case, None), 1024, exact_model=True)
    return rate_rows(case, samples, GRID, outcome_count=200, **options)


def test_a_second_load_identifies_cohesion_and_a_repetition_does_not(case):
    found = after(case, [0.6] * 3, [60.0] * 3)
    assert found.current_fraction[0] > NOT_IDENTIFIED_ABOVE
    best = found.best("cohesion")
    repeat = next(c for c in found.choices if (c.slip, c.load) == (0.6, 60.0))
    assert best.load != 60.0
    assert best.remaining_fraction[0] < 0.65 * repeat.remaining_fraction[0]


@pytest.mark.slow
def test_the_realised_width_after_a_plan_is_the_expected_one(case):
    planned = rate_rows(case, samples_of_prior(select_free(case, None), 1500), GRID).best()
    points = [(planned.slip, planned.load)]
    rng, free, left = np.random.default_rng(4), select_free(case, None), []
    slip, load = np.asarray(points).T
    for _ in range(16):
        true = {f.path: float(f.prior.at(rng.random())) for f in free}
        table = torque_rows(case, true, slip, load, noise=0.02, seed=rng)
        found = samples_of_rows(case, usable_readings(case, table), free, exact_model=True)
        left.append(found.remaining_fraction)
    realised = np.sqrt(np.mean(np.square(left), axis=0))
    np.testing.assert_allclose(planned.remaining_fraction, realised, atol=0.15)  # 3 sigma


def test_points_without_equilibrium_on_possible_soils_are_excluded_and_counted(case):
    heavy = candidate_grid([0.2], [60.0, 1e6])
    found = rate_rows(case, samples_of_prior(select_free(case, None), 64), heavy)
    assert found.excluded_points == 1 and {c.load for c in found.choices} == {60.0}
    with pytest.raises(FitError, match="smaller loads"):
        rate_rows(case, samples_of_prior(select_free(case, None), 64), candidate_grid([0.2], [1e6]))


@pytest.mark.slow
def test_samples_of_rows_are_as_wide_and_as_correlated_as_the_posterior(case):
    table = torque_rows(case, {}, np.asarray([0.1, 0.5, 0.5]), np.asarray([60.0, 60.0, 110.0]))
    free = select_free(case, None)
    fit = identify(case, table, None, "posterior")
    posterior = samples_of_rows(case, usable_readings(case, table), free, exact_model=True)
    left = posterior.remaining_fraction
    np.testing.assert_allclose(left, list(fit.remaining_fraction.values()), rtol=0.06)
    spread = (posterior.standardised.T * posterior.weights) @ posterior.standardised
    np.testing.assert_allclose(spread / np.outer(left, left), fit.correlation, atol=0.08)
