"""The response surface approximates the wheel."""

import numpy as np

from soilml.physics.model import Model
from soilml.physics.operating_point import Operating


def test_the_error_of_the_response_is_as_declared(wheel_posterior):
    family, response = wheel_posterior.family, wheel_posterior.response
    designs = family.designs(200, 99)
    rng = np.random.default_rng(1)
    x = np.stack([axis.quantile(rng.random(30)) for axis in family.axes], axis=1)
    true = family.responses(designs, np.broadcast_to(x, (200, 30, 3)))
    off = response.predict(family.features(designs), x) - true
    rms = np.sqrt(np.nanmean(off**2, axis=(0, 1)))
    assert (rms < 1.5 * response.error).all()
    assert (response.error < 0.05).all()


def test_the_simulated_wheel_is_that_of_the_recipe(wheel_posterior):
    family = wheel_posterior.family
    design, x = np.asarray([[0.3, 60.0]]), np.zeros((1, 1, 3))
    values = {axis.name: float(axis.value(np.zeros(1))[0]) for axis in family.axes}
    case = family.recipe.case.with_values(values)
    force = Model(case.model.gear, case.model.effects)(case.soil, Operating(slip=0.3, load=60.0))
    torque, depth, pull = family.responses(design, x)[0, 0]
    assert np.isclose(np.exp(torque) * 60.0, force.torque)
    assert np.isclose(np.exp(depth), force.sinkage)
    assert np.isclose(pull * 60.0, force.drawbar_pull)
