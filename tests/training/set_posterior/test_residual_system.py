"""Readings become rows of a linear system, in standard deviations of their noise."""

import numpy as np
import pytest

from training.set_posterior.monomials import monomials
from training.set_posterior.validation import graph_outputs, posterior_session


@pytest.fixture(scope="module")
def session(wheel_posterior):
    return posterior_session(wheel_posterior)


@pytest.fixture(scope="module")
def sets(wheel_posterior):
    return wheel_posterior.family.sets(40, 6, 3)


def test_the_system_has_residuals_over_noise(wheel_posterior, session, sets):
    response, x = wheel_posterior.response, np.asarray([0.2, -0.4, 0.6])
    index = int(np.argmax(sets.readings["sinkage_std"][:, 0] < 1.0))
    system = graph_outputs(session, response, sets, index)["memory_out"].astype(np.float64)
    own = sets.rows(index)
    y = response.predict(np.log(np.stack([own["slip"], own["load"]], axis=1)), x)
    share = own["torque_std"] / own["torque"]
    off = {
        "torque": y[:, 0] - np.log(own["torque"] / own["load"]) - 0.5 * share**2,
        "sinkage": y[:, 1] - np.log(own["sinkage"]),
        "drawbar_pull": y[:, 2] - own["drawbar_pull"] / own["load"],
    }
    noise = (share, own["sinkage_std"] / own["sinkage"], own["drawbar_pull_std"] / own["load"])
    for k, (values, std) in enumerate(zip(off.values(), noise, strict=True)):
        found = system[k::3, : len(response.terms)] @ monomials(x, response.terms)
        assert found == pytest.approx(values / np.hypot(std, response.error[k]), abs=2e-3)
