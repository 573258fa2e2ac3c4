"""Joining what three estimators say of a soil."""

import numpy as np
import pytest

from soilml.systems.wheel_legs.sensor_fusion import (
    PROPERTIES,
    SENSORS,
    fit_estimators,
    score_estimators,
)
from soilml.systems.wheel_legs.stances import simulate_stances

LEARN, HOLD = simulate_stances(300, seed=1), simulate_stances(300, seed=7)


@pytest.fixture(scope="module", params=PROPERTIES)
def estimators(request):
    return fit_estimators(LEARN, request.param)


def test_the_best_linear_rule_errs_no_more_than_any_other(estimators):
    found = score_estimators(estimators, HOLD)
    for name in (*SENSORS, "pairwise", "inverse variance"):
        assert found["best linear"].rmse < 1.03 * found[name].rmse, name


def test_rules_for_independent_errors_are_overconfident_for_correlated_errors(estimators):
    found = score_estimators(estimators, HOLD)
    assert np.abs(estimators.correlation[np.triu_indices(3, 1)]).max() > 0.5
    assert found["inverse variance"].coverage_95 < 0.92
    assert found["pairwise"].coverage_95 < 0.92
    assert found["best linear"].coverage_95 == pytest.approx(0.95, abs=0.035)
