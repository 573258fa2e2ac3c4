"""Joining what three senses say of a soil."""

import numpy as np
import pytest

from soilml.errors import FitError
from soilml.systems.wheel_legs.sensing.sensor_fusion import (
    PROPERTIES,
    RULES,
    SENSES,
    judged,
    learned,
)
from soilml.systems.wheel_legs.sensing.simulated_stances import felt

LEARN, HOLD = felt(300, seed=1), felt(300, seed=7)


@pytest.fixture(scope="module", params=PROPERTIES)
def senses(request):
    return learned(LEARN, request.param)


def test_the_best_linear_rule_errs_no_more_than_any_other(senses):
    found = judged(senses, HOLD)
    for name in (*SENSES, "pairwise", "inverse variance"):
        assert found["best linear"].rmse < 1.03 * found[name].rmse, name


def test_rules_for_independent_errors_claim_too_much_where_errors_go_together(senses):
    found = judged(senses, HOLD)
    assert np.abs(senses.correlation[np.triu_indices(3, 1)]).max() > 0.5
    assert found["inverse variance"].within_two < 0.92
    assert found["pairwise"].within_two < 0.92
    assert found["best linear"].within_two == pytest.approx(0.95, abs=0.035)


def test_sinkage_tells_the_stiffness_better_than_torque_or_vibration():
    found = judged(learned(LEARN, "normal_stiffness"), HOLD)
    assert found["sinkage"].rmse < 0.7 * min(found["torque"].rmse, found["vibration"].rmse)


def test_weights_sum_to_one_for_every_stance(senses):
    for rule in RULES:
        weights = senses.joined(HOLD, rule).weights
        assert weights.shape == (3, 300)
        np.testing.assert_allclose(weights.sum(axis=0), 1.0)


def test_a_few_stances_are_refused():
    with pytest.raises(FitError, match="5 stances are given; 20 or more"):
        learned(felt(5, seed=1), "friction_angle")
