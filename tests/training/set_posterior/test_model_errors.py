"""Errors of the model as columns of the residual system."""

from dataclasses import replace

import numpy as np
import pytest

from datagen.recipe import read_recipe
from soilml.config.measurement_noise import Noise
from soilml.onboard.set_contract import (
    COMMON_ERROR_INPUTS,
    LAW_ERROR_COLUMNS,
    MEMORY_INPUTS,
    MODEL_ERROR_COLUMNS,
)
from soilml.physics.effects.contact_shape import ExitAngle
from soilml.quantities import SHEAR
from training.onnx_graph.builder import Graph, session_of
from training.onnx_graph.value import Value, constant
from training.set_posterior.families.recipe_family import RecipeFamily
from training.set_posterior.families.wheel_family import LAW_ERRORS
from training.set_posterior.graph import ROW_INPUTS, SetPosteriorGraph
from training.set_posterior.monomials import monomials
from training.set_posterior.residual_system import add_residual_rows
from training.set_posterior.response_surface import ResponseSettings, fit_response

pytestmark = pytest.mark.slow

#: A soil at which the columns are taken.
SOIL = np.asarray([0.5, -0.6, 0.4])
SLIP, LOAD = np.asarray([0.08, 0.2, 0.35, 0.55]), np.asarray([40.0, 60.0, 100.0, 80.0])


@pytest.fixture(scope="module")
def linear_posterior():
    """The set posterior of a wheel whose torque has constant noise: its scale is without load."""
    recipe = read_recipe("wheel")
    noise = recipe.case.noise | {"torque_Nm": Noise(constant=0.05)}
    family = RecipeFamily.of(replace(recipe, case=replace(recipe.case, noise=noise)), SHEAR)
    response = fit_response(family, ResponseSettings(768, 32, 120, 0), lambda *_: None)
    return SetPosteriorGraph(family, response, None)


def model_columns(posterior, readings, size) -> np.ndarray:
    """Columns (channels, rows, errors) of errors of the model, on the scales of the channels."""
    graph = Graph()
    inputs = {name: Value(graph, name) for name in posterior.inputs if name not in MEMORY_INPUTS}
    inputs |= {name: inputs[name].reshape(1, -1) for name in ROW_INPUTS}
    rows = add_residual_rows(posterior.family, posterior.response, inputs)
    basis = monomials(SOIL, posterior.response.terms)
    columns = rows.columns_at(constant(graph, basis[:, None]))
    columns.node("Compress", rows.used, axis=0).named("out")
    shapes = {key: posterior.inputs[key] for key in inputs}
    session = session_of(graph.model(shapes, {"out": (1, ["m", "columns"])}))
    noise = {"torque_std": 0.01 * readings["torque"], "sinkage_std": 0.01 * readings["sinkage"]}
    noise["drawbar_pull_std"] = np.full(len(SLIP), 0.5)
    feed = {key: np.zeros(1 if key in COMMON_ERROR_INPUTS else len(SLIP)) for key in inputs}
    feed |= readings | noise | {"model_error": np.full(1, size)}
    feed = {key: values.astype(np.float32) for key, values in feed.items()}
    system = session.run(None, feed)[0].astype(np.float64)
    stds = [
        noise["torque_std"] * posterior_slope(posterior, readings),
        np.full(len(SLIP), 0.01),
        0.5 / readings["load"],
    ]
    std = np.hypot(stds, posterior.response.error[:, None]).T.reshape(-1, 1)
    own = (system * std)[:, -len(MODEL_ERROR_COLUMNS) :]
    return own.reshape(len(SLIP), 3, -1).swapaxes(0, 1)


def posterior_slope(posterior, readings) -> np.ndarray:
    """Derivative of the scale of torque by torque."""
    linear = posterior.family.linear_torque
    return 1.0 / np.sqrt(readings["torque"] ** 2 + 4.0 * linear**2)


def true_readings(family) -> dict[str, np.ndarray]:
    """Exact readings at the soil."""
    case = family.recipe.case
    y = family.responses(np.stack([SLIP, LOAD], axis=1), SOIL[None, None])[:, 0]
    linear = family.linear_torque
    torque = 2.0 * linear * np.sinh(y[:, 0]) if linear else np.exp(y[:, 0]) * LOAD
    assert case.model.gear.name == "wheel"
    readings = {"slip": SLIP, "load": LOAD, "torque": torque}
    return readings | {"sinkage": np.exp(y[:, 1]), "drawbar_pull": y[:, 2] * LOAD}


@pytest.mark.parametrize("kind", ["wheel_posterior", "linear_posterior"])
def test_the_column_of_the_contact_is_the_change_by_the_effect(kind, request):
    posterior = request.getfixturevalue(kind)
    family, readings = posterior.family, true_readings(posterior.family)
    found = model_columns(posterior, readings, -1.0)[:, :, 3]
    kappa = ExitAngle.about.reference["kappa"]
    case = family.recipe.case
    model = replace(case.model, effects=(ExitAngle(kappa=kappa),))
    other = replace(family, recipe=replace(family.recipe, case=replace(case, model=model)))
    designs = np.stack([SLIP, LOAD], axis=1)
    change = other.responses(designs, SOIL[None, None]) - family.responses(
        designs, SOIL[None, None]
    )
    expected = change[:, 0].T
    for channel in range(3):
        tolerance = 0.1 * np.abs(expected[channel]).max()
        assert found[channel] == pytest.approx(expected[channel], abs=tolerance)


@pytest.mark.parametrize("kind", ["wheel_posterior", "linear_posterior"])
def test_columns_of_the_laws_are_changes_with_strength_and_shear_modulus(kind, request):
    posterior, step = request.getfixturevalue(kind), 1e-3
    family, readings = posterior.family, true_readings(posterior.family)
    found = model_columns(posterior, readings, -1.0)[:, :, -len(LAW_ERROR_COLUMNS) :]
    designs = family.features(np.stack([SLIP, LOAD], axis=1))
    ends = np.linspace(-1.0, 1.0, 20001)

    def channels(factor, names):
        """Channels (rows, 3) where these unknowns, or the tangent of the angle, are larger."""
        x = SOIL.copy()
        for i, axis in enumerate(family.axes):
            if axis.name in names:
                own = axis.value(SOIL[i])
                is_angle = axis.name == "friction_angle"
                larger = np.arctan(factor * np.tan(own)) if is_angle else factor * own
                x[i] = np.interp(larger, axis.value(ends), ends)
        return posterior.response.predict(designs, x)

    def change(*names):
        return (channels(1.0 + step, names) - channels(1.0 - step, names)) / (2.0 * step)

    of_load = np.log(LOAD / float(family.recipe.load.at(np.asarray(0.5))))[:, None]
    strength = change("cohesion", "friction_angle")
    for name, expected in (
        ("strength", strength),
        ("strength_by_load", of_load * strength),
        ("shear_modulus", change("shear_modulus")),
    ):
        own = found[:, :, LAW_ERROR_COLUMNS.index(name)].T / LAW_ERRORS[name]
        assert own == pytest.approx(expected, abs=0.01 * np.abs(expected).max())
