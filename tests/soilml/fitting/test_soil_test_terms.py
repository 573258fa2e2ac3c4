"""Plate and shear tests of the soil that take part like further readings."""

from dataclasses import replace

import numpy as np
import pytest

from soilml import Case, Model, Operating, Table, Wheel, identify, read_case, soil
from soilml.config.measurement_noise import Noise
from soilml.config.write_case import case_as_toml
from soilml.errors import InputError
from soilml.experiment_design.parameter_samples import samples_of_prior
from soilml.fitting.coordinates import select_free
from soilml.fitting.least_squares import SoilTestTerms
from soilml.fitting.misfit import problem_under_noise
from soilml.fitting.usable_readings import usable_readings
from soilml.identification.posterior import posterior_density, prior_fractions
from soilml.numerics.prior import Prior
from soilml.physics.soils.soil_tests import PlatePressure, ShearStrength
from soilml.remarks import texts
from soilml.traction import prior_draws

SAND = soil("wong1989/dry_sand")
PLATE = PlatePressure(plate_width=0.05, sinkage=0.02, pressure=20000.0, scatter=0.15)
SHEAR = ShearStrength(normal_stress=8000.0, strength=5000.0, scatter=0.1)
SLIP, LOAD = np.tile(np.linspace(0.05, 0.6, 6), 2), np.repeat([40.0, 100.0], 6)


def a_case(**changes):
    priors = {"cohesion": Prior(0.0, 3000.0), "friction_angle": Prior(0.3, 0.8)}
    noise = {"torque_Nm": Noise(share=0.02)}
    return replace(Case(Model(Wheel(radius=0.15, width=0.12)), SAND, priors, noise), **changes)


def some_rows(case, soil_of_rows=SAND, seed=0):
    torque = case.model(soil_of_rows, Operating(slip=SLIP, load=LOAD)).torque
    noise = 1.0 + 0.02 * np.random.default_rng(seed).standard_normal(SLIP.size)
    return Table({"slip": SLIP, "load_N": LOAD, "torque_Nm": torque * noise})


def test_model_file_keeps_tests_and_takes_units(tmp_path):
    text = case_as_toml(a_case())
    tests = (
        '[[soil.test]]\nplate_width = "5 cm"\nsinkage = "20 mm"\npressure = "20 kPa"\n'
        'scatter = "15 %"\n[[soil.test]]\nnormal_stress = "8 kPa"\nstrength = 5000\nscatter = 0.1\n'
    )
    path = tmp_path / "model.toml"
    path.write_text(text.replace("[noise]", f"{tests}\n[noise]"))
    case = read_case(path)
    assert case.soil_tests == (PLATE, SHEAR)
    path.write_text(case_as_toml(case))
    assert read_case(path) == case


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ("scatter = 0.1", "needed is pressure"),
        ("strength = 5000\nscatter = 0.1", "normal_stress"),
        ("pressure = 1e4\nplate_width = 0.1\nsinkage = 0.02", "scatter is missing"),
        ("strength = 5000\nnormal_stress = 8000\nscatter = 0", "scatter"),
        ("strength = 5000\nnormal_stress = 8000\nscatter = 0.1\nload = 3", "unknown key 'load'"),
        ("strength = -5\nnormal_stress = 8000\nscatter = 0.1", "strength"),
    ],
)
def test_wrong_tests_are_refused(tmp_path, lines, message):
    path = tmp_path / "model.toml"
    text = case_as_toml(a_case())
    path.write_text(text.replace("[noise]", f"[[soil.test]]\n{lines}\n\n[noise]"))
    with pytest.raises(InputError, match=message):
        read_case(path)


@pytest.mark.slow
def test_posterior_with_a_test_is_that_of_a_grid():
    case = a_case(soil_tests=(SHEAR,))
    table = some_rows(case)
    data, free = usable_readings(case, table), select_free(case, None)
    middle = (np.arange(120) + 0.5) / 120
    u = np.stack(np.meshgrid(middle, middle, indexing="ij"), axis=-1).reshape(-1, 2)
    values = np.stack([f.prior.at(u[:, i]) for i, f in enumerate(free)], axis=1)
    strength = values[:, 0] + 8000.0 * np.tan(values[:, 1])
    problem = problem_under_noise(a_case(), data, free)
    logs = posterior_density(problem, np.full(2, 0.5))(u)
    logs = logs - 0.5 * (np.log(strength / 5000.0) / 0.1) ** 2
    weights = np.exp(logs - logs.max())
    weights /= weights.sum()
    mean = weights @ values
    std = np.sqrt(weights @ (values - mean) ** 2)
    for method, tolerance in (("posterior", 0.06), ("nonlinear", 0.25)):
        fit = identify(case, table, method=method)
        assert (np.abs(fit.values - mean) < tolerance * std).all(), method
        np.testing.assert_allclose(fit.std, std, rtol=1.5 * tolerance, err_msg=method)


def test_a_test_narrows_what_rows_leave_open():
    priors = {"kphi": Prior(3e5, 5e6, log=True), "n": Prior(0.7, 1.4)}
    case = a_case(prior=priors)
    table = some_rows(case)
    pressure = float(PLATE.predicted({"kc": SAND.kc, "kphi": SAND.kphi, "n": SAND.n}))
    test = replace(PLATE, pressure=pressure, scatter=0.03)
    alone, both = (
        identify(replace(case, soil_tests=tests), table, method="posterior")
        for tests in ((), (test,))
    )
    assert (both.std < 0.9 * alone.std).all()


def test_rows_that_disagree_with_a_test_are_remarked_on():
    case = a_case(soil_tests=(replace(SHEAR, strength=9000.0, scatter=0.05),))
    fit = identify(case, some_rows(case), method="nonlinear")
    (text,) = [line for line in texts(fit.warnings) if "disagree with a test of the soil" in line]
    assert "shear strength under 8 kPa was 9 kPa in the test" in text
    case = a_case(soil_tests=(SHEAR,))
    assert "disagree" not in " ".join(
        texts(identify(case, some_rows(case), method="nonlinear").warnings)
    )


def test_draws_of_the_prior_follow_tests():
    case = a_case(soil_tests=(SHEAR,))
    free = select_free(case, None)
    u = prior_fractions(free, 400, np.random.default_rng(0), case)
    z = SoilTestTerms(case, free).deviation(u)[:, 0]
    loose = prior_fractions(free, 20000, np.random.default_rng(1))
    every = SoilTestTerms(case, free).deviation(loose)[:, 0]
    weights = np.exp(-0.5 * every**2)
    mean = np.average(every, weights=weights)
    std = np.sqrt(np.average((every - mean) ** 2, weights=weights))
    assert every.std() > 1.5 * std
    assert abs(z.mean() - mean) < 0.1
    assert abs(z.std() / std - 1.0) < 0.1
    np.testing.assert_array_equal(samples_of_prior(free, 400, 0, case).u, u)
    values = prior_draws(free, 400, case).values
    np.testing.assert_allclose(values[:, 1], free[1].prior.at(u[:, 1]))
