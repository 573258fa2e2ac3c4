"""Tests for the pull under another gravity, beside what simulation of them all gives."""

from dataclasses import replace

import numpy as np
import pytest

from soilml import Operating, read_case
from soilml.config.measurement_noise import Noise
from soilml.experiment_design import samples_of_prior
from soilml.experiment_design.transfer_tests import advise_transfer
from soilml.fitting.coordinates import select_free
from soilml.numerics.prior import Prior
from soilml.physics.soils.gravity_law import GravityChange

EARTH, MOON = 9.80665, 1.62
LOAD, SLIP = 20.0, 0.3


def toy(model_file, **changes):
    """A case whose friction angle alone is unknown, and samples of it."""
    case = replace(read_case(model_file), prior={"friction_angle": Prior(0.4, 0.8)}, **changes)
    return case, samples_of_prior(select_free(case, None), 1024)


def test_the_expectations_are_those_of_a_simulation_of_every_outcome(model_file):
    noise = {"torque_Nm": Noise(share=0.1), "drawbar_pull_N": Noise(constant=1.5)}
    case, samples = toy(model_file, noise=noise)
    change = GravityChange(EARTH, MOON)
    found = advise_transfer(case, samples, change, LOAD, SLIP, loads=[60.0], slips=[0.2])
    (test,) = [one for one in found.tests if one.load == 60.0]
    rng, phi, law = np.random.default_rng(5), np.linspace(0.4, 0.8, 301), change.draws(300, seed=7)
    soil = {name: getattr(case.soil, name) for name in ("kphi", "shear_modulus")}
    there = change.parameters(soil | {"friction_angle": phi[:, None]}, law)
    pull = case.model(replace(case.soil, **there), Operating(slip=SLIP, load=LOAD)).drawbar_pull
    assert found.known_std == pytest.approx(pull.std(), rel=0.03)
    assert found.least_std == pytest.approx(np.sqrt(pull.var(axis=1).mean()), rel=0.03)
    here = replace(case.soil, friction_angle=phi)
    force = case.model(here, Operating(slip=0.2, load=60.0))
    left = []
    for i in rng.integers(0, len(phi), 1500):
        log = 0.0
        for y, std in ((force.torque, 0.1 * force.torque), (force.drawbar_pull, 1.5 + 0.0 * phi)):
            reading = y[i] + std[i] * rng.standard_normal()
            log = log - 0.5 * ((reading - y) / std) ** 2 - np.log(std)
        weight = np.exp(log - log.max())
        weight /= weight.sum()
        left.append(weight @ (pull**2).mean(axis=1) - (weight @ pull.mean(axis=1)) ** 2)
    assert test.pull_std == pytest.approx(np.sqrt(np.mean(left)), rel=0.03)
    level = case.model(here, Operating(slip=SLIP, load=60.0)).drawbar_pull
    read = (level[:, None] + 1.5 * rng.standard_normal(pull.shape)) * LOAD / 60.0
    assert test.scaled_error == pytest.approx(np.sqrt(np.mean((pull - read) ** 2)), rel=0.03)
    assert test.speed_ratio == pytest.approx(np.sqrt(EARTH / MOON))
    least, *others = sorted(one.pull_std for one in found.tests)
    assert found.least_std <= least == found.best.pull_std and others[-1] <= found.known_std


def test_each_school_finds_its_own_test_where_no_model_is_used(model_file):
    dry = replace(read_case(model_file).soil, cohesion=0.0, kc=0.0)
    case, samples = toy(model_file, soil=dry, noise={"torque_Nm": Noise(share=0.02)})
    for law, load in (("constant", LOAD), ("proportional", LOAD * EARTH / MOON)):
        found = advise_transfer(case, samples, GravityChange(EARTH, MOON, law), LOAD)
        # without cohesion all forces are in proportion to gravity, and so is the pull
        assert found.best_scaled.load == pytest.approx(load)
        assert max(found.best_scaled.scaled_error, found.least_std) < 1e-6 * LOAD
