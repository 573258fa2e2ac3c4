"""Inputs of the graph, pooling of runs and fusion of rows, evaluated by hand."""

from dataclasses import replace

import numpy as np
import pytest
from made_estimates import made_estimate

from soilml.onboard.gaussian_product import PriorSummary
from soilml.onboard.set_contract import (
    ABSENT_READING,
    ABSENT_STD,
    COMMON_ERROR_INPUTS,
    ERROR_COLUMNS,
)
from soilml.onboard.set_posterior import SetPosterior, constant_noise_factor

SETS = SetPosterior(
    terms=4,
    noise={"torque": (0.3, 0.04), "sinkage": (0.001, 0.0), "torque_bias": (0.0, 0.01)},
    context_ranges={},
    context_values={},
    sets_only=True,
    common_errors=dict.fromkeys(COMMON_ERROR_INPUTS, 0.0),
    error_columns=len(ERROR_COLUMNS),
    least_share_in_range=0.5,
)
ROWS = {"slip": np.asarray([0.1, 0.2]), "torque": np.asarray([10.0, -5.0]), "load": 60.0}


def test_standard_deviations_are_those_of_the_noise_model_or_as_measured():
    rows = SETS.rows(ROWS)
    assert rows["load"].tolist() == [60.0, 60.0]
    assert rows["torque_std"] == pytest.approx([np.hypot(0.3, 0.4), np.hypot(0.3, 0.2)])
    assert rows["torque_bias"] == pytest.approx([0.1, 0.05])
    for name in ("sinkage", "drawbar_pull"):
        assert rows[name].tolist() == [ABSENT_READING] * 2
        assert rows[f"{name}_std"].tolist() == [ABSENT_STD] * 2
    more = SETS.rows(ROWS | {"sinkage": [0.01, np.nan], "torque_std": 0.7, "drawbar_pull": 3.0})
    assert more["sinkage"].tolist() == [0.01, ABSENT_READING]
    assert more["sinkage_std"].tolist() == [0.001, ABSENT_STD]
    assert more["torque_std"].tolist() == [0.7, 0.7]
    # a pull without noise, in the file or given, has no weight
    assert more["drawbar_pull_std"].tolist() == [ABSENT_STD] * 2
    # nor has a standard deviation without its reading
    alone = SETS.rows(ROWS | {"sinkage_std": 0.002})
    assert alone["sinkage"].tolist() == [ABSENT_READING] * 2
    assert alone["sinkage_std"].tolist() == [ABSENT_STD] * 2


def test_torques_with_constant_noise_are_reduced_where_their_logarithm_is_taken():
    found = SETS.with_context({}, {"torque": (0.3, 0.04)}).rows(ROWS)
    factor = np.exp(-2.0 * np.asarray([0.03, 0.06]) ** 2)
    assert found["torque"] == pytest.approx(ROWS["torque"] * factor)
    assert found["torque_std"] == pytest.approx(SETS.rows(ROWS)["torque_std"] * factor)
    later = SETS.with_context({}, {"torque": (0.3, 0.04)}).with_context({}, {"slip": (0.0, 0.0)})
    assert later.rows(ROWS)["torque"].tolist() == found["torque"].tolist()
    unchanged = (
        (SETS, {}),  # the noise of the file
        (SETS.with_context({}, {"torque": (0.0, 0.04)}), {}),  # a share of the reading
        (SETS.with_context({}, {"torque": (0.3, 0.04)}), {"torque_std": 0.3}),
        (replace(SETS, log_torque=False).with_context({}, {"torque": (0.3, 0.04)}), {}),
    )
    for sets, given in unchanged:
        assert sets.rows(ROWS | given)["torque"].tolist() == ROWS["torque"].tolist()


@pytest.mark.parametrize("constant, share", [(0.05, 0.0), (0.1, 0.0), (0.06, 0.08), (0.15, 0.02)])
def test_the_weighted_logarithm_of_torques_with_constant_noise_has_no_bias(constant, share):
    """Against a quadrature over the noise of a torque of 1 N m, weighted as the graph does."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(40)
    near = np.abs(nodes) < 6.0
    true_std = np.hypot(constant, share)
    reading = 1.0 + true_std * nodes[near]

    def bias(factor):
        relative = np.hypot(constant, share * reading) / reading
        log_torque = np.log(reading * factor) + 0.5 * relative**2
        total = weights[near] / relative**2
        return (total @ log_torque) / total.sum()

    before, after = bias(1.0), bias(constant_noise_factor(reading, constant))
    assert before > 1.8 * constant**2
    assert abs(after) < 0.1 * before


PRIOR = PriorSummary(*np.asarray([[1.0, 10.0], [0.5, 4.0], [0.0, 2.0], [2.0, 18.0]]))


def estimates(mean, std, in_range):
    return made_estimate(mean, std, PRIOR, in_range, ("a", "b"), ("1", "1"), factor=1.0)


def test_a_mean_within_one_and_a_half_standard_deviations_of_an_end_is_at_the_edge():
    mean = [[1.49, 10.0], [1.51, 10.0], [1.0, 3.51], [1.0, 3.49], [1.0, 16.6]]
    found = estimates(mean, [[1.0 / 3.0, 1.0]] * 5, [True] * 5)
    at_edge = [[False, False], [True, False], [False, False], [False, True], [False, True]]
    assert found.at_edge.tolist() == at_edge
