"""The short sampling of the graph agrees with a long sampling."""

import sys
from pathlib import Path

import numpy as np
import pytest

from soilml.onboard.set_contract import ABSENT_STD
from training.set_posterior.posterior_summary import INTERVAL
from training.set_posterior.validation import graph_outputs, posterior_session

sys.path.insert(0, str(Path(__file__).parents[3] / "bench"))

from exact_sets import FRACTIONS, posterior_of_memory

pytestmark = pytest.mark.slow


def compare(posterior, sets, index, session):
    """Outputs of the graph, and mean, standard deviation and interval of a long sampling."""
    answer = graph_outputs(session, posterior.response, sets, index)
    found = posterior_of_memory(
        posterior.family, answer["memory_out"].astype(np.float64), sets, index
    )
    ends = found.quantiles[[FRACTIONS.index(end) for end in INTERVAL]]
    return answer, found.mean, np.sqrt(np.diag(found.covariance)), ends


@pytest.mark.parametrize("rows", [1, 16])
def test_mean_spread_and_interval_are_those_of_the_exact_sampler(wheel_posterior, rows):
    session, sets = posterior_session(wheel_posterior), wheel_posterior.family.sets(8, rows, 9)
    apart, ratios, ends = [], [], []
    for index in range(len(sets.truth)):
        answer, mean, std, both = compare(wheel_posterior, sets, index, session)
        if not answer["set_in_range"][0]:
            continue
        apart.append((answer["set_mean"] - mean) / std)
        ratios.append(answer["set_std"] / std)
        ends += [(answer["set_low"] - both[0]) / std, (answer["set_high"] - both[1]) / std]
    assert len(apart) >= 5
    assert np.sqrt(np.mean(np.square(apart))) < 0.15
    assert 0.95 < np.median(ratios) < 1.08
    assert np.abs(np.median(ends)) < 0.1


def test_the_thin_posterior_of_constant_operating_conditions_is_sampled(wheel_posterior):
    family, session = wheel_posterior.family, posterior_session(wheel_posterior)
    drawn = family.sets(60, 16, 2)
    steady = np.flatnonzero(
        (np.ptp(drawn.readings["slip"], axis=1) == 0.0)
        & (np.ptp(drawn.readings["load"], axis=1) == 0.0)
    )
    assert len(steady)
    for index in steady[:3]:
        answer, mean, std, _ = compare(wheel_posterior, drawn, index, session)
        if answer["set_in_range"][0]:
            assert (np.abs(answer["set_mean"] - mean) < 0.3 * std).all()
            assert (np.abs(np.log(answer["set_std"] / std)) < 0.25).all()


def test_a_soil_in_a_corner_of_the_prior_is_found(wheel_posterior):
    family, session = wheel_posterior.family, posterior_session(wheel_posterior)
    sets, rng = family.sets(4, 16, 21), np.random.default_rng(0)
    apart = []
    for index in range(len(sets.truth)):
        x = np.broadcast_to((0.97, 0.97, -0.97), (16, 1, 3))
        answers = family.responses(sets.designs[index], x)[:, 0]
        torque = np.exp(answers[:, 0]) * sets.readings["load"][index]
        sets.readings["torque_std"][index] = 0.02 * torque
        sets.readings["torque"][index] = torque * (1.0 + 0.02 * rng.standard_normal(16))
        for name in ("sinkage", "drawbar_pull"):
            sets.readings[name][index], sets.readings[f"{name}_std"][index] = 1.0, ABSENT_STD
        answer, mean, std, _ = compare(wheel_posterior, sets, index, session)
        if answer["set_in_range"][0]:
            apart.append((answer["set_mean"] - mean) / std)
    assert len(apart) >= 2
    assert np.sqrt(np.mean(np.square(apart))) < 0.5
