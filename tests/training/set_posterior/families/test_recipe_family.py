"""Recipes that a set posterior supports, and the noise of simulated sets."""

import numpy as np
import pytest


def test_simulated_torque_has_the_noise_of_the_recipe(wheel_posterior):
    family = wheel_posterior.family
    sets = family.sets(400, 8, 4)
    true = np.exp(
        family.responses(
            sets.origin.designs.reshape(-1, 2), np.repeat(sets.origin.x, 8, 0)[:, None]
        )[:, 0, 0]
    )
    true = true.reshape(-1, 8) * sets.readings["load"]
    off = (sets.readings["torque"] - true) / sets.readings["torque_std"]
    bias = sets.readings["torque_bias"] / sets.readings["torque_std"]
    assert np.std(off) == pytest.approx(np.sqrt(1.0 + np.mean(bias**2)), rel=0.08)
