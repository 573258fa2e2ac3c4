"""Model files written anew around the response surface that they have, without training it again.

For files whose response stays as it is while the rest of the graph of a set posterior changes:
`python exported/make.py --graphs NAME ...`.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from datagen.recipe import parse_recipe
from soilml.arrays import Floats
from soilml.errors import ModelFileError
from soilml.io.toml_settings import Settings
from soilml.onboard.set_contract import INTERFACE, RESPONSE_CHANNELS, SET_SWITCH
from training.export.model_file import write_model
from training.onnx_graph.builder import Graph, Output
from training.regressors.standardisation import Standardisation
from training.set_posterior.error_scales import USUAL_SCALES, ErrorScales
from training.set_posterior.families.dimensionless_family import DimensionlessFamily
from training.set_posterior.families.recipe_family import RecipeFamily
from training.set_posterior.families.wheel_family import WheelFamily
from training.set_posterior.graph import SetPosteriorGraph
from training.set_posterior.misfit_test import MisfitLimits
from training.set_posterior.monomials import Terms
from training.set_posterior.residual_system import BOX_TOLERANCE
from training.set_posterior.response_surface import Response, family_terms
from training.set_posterior.validation import metadata_of, probe_of_sets

CHANNELS = len(RESPONSE_CHANNELS)


def write_anew(path: Path) -> None:
    """Write the set posterior of a model file anew; estimates of single rows stay as they are.

    Raises `ModelFileError` for a file without a set posterior, or one of another structure.
    """
    import onnx

    model = onnx.load(path)
    metadata = {entry.key: entry.value for entry in model.metadata_props}
    if "set" not in metadata:
        raise ModelFileError(f"{path} has no set posterior")
    sets = json.loads(metadata["set"])
    family = _family(metadata, sets, path)
    branch = model.graph if sets["alone"] else _branch(model, "then_branch")
    limits = MisfitLimits(*(np.asarray(sets["misfit"][key]) for key in ("readings", "most")))
    terms = tuple(tuple(term) for term in sets.get("monomials", ())) or family_terms(family)
    response = read_response(branch, family, sets["error"], terms)
    response = replace(response, carried=float(sets.get("carried", 1.0)))
    small = bool(sets.get("small", False))
    posterior = SetPosteriorGraph(
        family, response, limits, sets["noise"], small, _scales(sets), _sensor_errors(metadata)
    )
    graph = Graph("" if sets["alone"] else "sets_")
    posterior.add_to(graph, "" if sets["alone"] else "sets_")
    if sets["alone"]:
        for name, value in posterior.defaults().items():
            graph.default(name, value)
        found = graph.model(posterior.inputs, posterior.outputs)
    else:
        found = _beside_single_rows(model, graph, posterior)
    probe = [one for one in json.loads(metadata["probe"]) if "given" not in one]
    changed = {
        "soilml_interface": INTERFACE,
        "set": json.dumps(metadata_of(posterior, sets_only=sets["alone"])),
        "probe": json.dumps([*probe, *probe_of_sets(posterior)]),
    }
    write_model(found, metadata | changed, path)


def _family(metadata: Mapping[str, str], sets: Mapping[str, Any], path: Path) -> WheelFamily:
    """The family of wheels that a file was trained for, from the recipe or spec in its metadata."""
    if sets["alone"]:
        ranges = json.loads(metadata["spec"])["any_wheel"]
        return DimensionlessFamily.take(Settings(ranges, "[any_wheel]"))
    targets = [entry["name"] for entry in json.loads(metadata["outputs"])]
    return RecipeFamily.of(parse_recipe(metadata["recipe"], str(path)), targets)


def _scales(sets: Mapping[str, Any]) -> ErrorScales:
    """Scales of the model's errors; the usual ones where a file states none."""
    stated = sets.get("model_error_scales")
    return USUAL_SCALES if stated is None else ErrorScales.of_list(stated)


def _sensor_errors(metadata: Mapping[str, str]) -> dict[str, float]:
    """Errors of the sensors that the spec of a file states."""
    stated = json.loads(metadata["spec"]).get("set_posterior", {}).get("sensor_errors", {})
    return {name: float(std) for name, std in stated.items()}


def _branch(model: Any, name: str) -> Any:
    """A branch of the graph's only node."""
    return next(a.g for a in model.graph.node[0].attribute if a.name == name)


def _beside_single_rows(model: Any, sets: Graph, posterior: SetPosteriorGraph) -> Any:
    """The model with another branch for sets."""
    from onnx import checker, helper, numpy_helper

    kinds = {o.name: (o.type.tensor_type.elem_type, o) for o in model.graph.output}
    outputs: dict[str, Output] = {
        name: (kind, [None] * len(entry.type.tensor_type.shape.dim))
        for name, (kind, entry) in kinds.items()
    }
    changed = type(model)()
    changed.CopyFrom(model)
    changed.ClearField("metadata_props")
    node = changed.graph.node[0]
    for attribute in node.attribute:
        if attribute.name == "then_branch":
            attribute.g.CopyFrom(sets.as_branch(outputs))
    defaults = posterior.defaults()
    changed.functions.extend(sets.functions.values())
    changed.opset_import.extend(helper.make_opsetid(*one) for one in sets.opsets[1:])
    del changed.graph.initializer[:]
    for name, value in (defaults | {SET_SWITCH: np.zeros(1, bool)}).items():
        changed.graph.initializer.append(numpy_helper.from_array(np.asarray(value), name))
    for entry in changed.graph.input:
        if entry.name in posterior.inputs:
            _resize(entry, posterior.inputs[entry.name])
    checker.check_model(changed, full_check=True)
    return changed


def _resize(entry: Any, shape: list[Any]) -> None:
    """Give an input the shape that it has now."""
    for dimension, size in zip(entry.type.tensor_type.shape.dim, shape, strict=True):
        if isinstance(size, int):
            dimension.dim_value = size


def read_response(
    graph: Any, family: WheelFamily, error: Mapping[str, float], terms: Terms
) -> Response:
    """The response surface in the graph of a set posterior, as `Response.add_to` wrote it.

    Raises `ModelFileError` for a graph of another structure.
    """
    constants = _constants(graph)
    ends = _box(graph, constants)
    layers, mean = _layers(graph.node, constants)
    if len(layers) != 3:
        raise ModelFileError("the graph has no response surface of two hidden layers")
    (first, bias), (second, second_bias), (last, last_bias) = layers
    # the last columns of the last layer subtract the readings
    whole = (first.T, bias, second.T, second_bias, last[:, : len(second)].T, last_bias)
    scaling = Standardisation(mean, np.ones_like(mean))
    errors = np.asarray([error[name] for name in RESPONSE_CHANNELS])
    response = Response(terms, scaling, whole, *ends, errors)
    if not family.model_errors()["contact"]:
        return response
    return replace(response, contact=_read_contact(graph, response))


def _read_contact(graph: Any, response: Response) -> Response:
    """The surface of the changes by another contact, in the branch of a model with errors."""
    for branch in _branches(graph):
        constants = _constants(branch)
        layers, mean = _layers(branch.node, constants)
        if len(layers) == 2:
            break
    else:
        raise ModelFileError("the graph has no response surface of another contact")
    (first, bias), (second, second_bias) = layers
    units, terms = len(second) + 1, len(response.terms)
    shape = (units * CHANNELS, terms)
    last = next(
        constants[name]
        for node in branch.node
        for name in node.input
        if node.op_type == "MatMul" and name in constants and constants[name].shape == shape
    )
    flat = last.reshape(CHANNELS, units, terms).transpose(1, 2, 0).reshape(units, -1)
    whole = (first.T, bias, second.T, second_bias, flat[:-1], flat[-1])
    scaling = Standardisation(mean, np.ones_like(mean))
    return replace(response, scaling=scaling, layers=whole, error=np.zeros(CHANNELS))


def _branches(graph: Any) -> Iterator[Any]:
    """All branches of a graph, and the branches of these."""
    for branch in (a.g for node in graph.node if node.op_type == "If" for a in node.attribute):
        yield branch
        yield from _branches(branch)


def _constants(graph: Any) -> dict[str, Floats]:
    from onnx import numpy_helper

    return {c.name: numpy_helper.to_array(c).astype(np.float64) for c in graph.initializer}


def _layers(
    nodes: Iterable[Any], constants: Mapping[str, Floats]
) -> tuple[list[tuple[Floats, Floats]], Floats]:
    """Weights and biases (units,) of layers, and what is subtracted from their first inputs."""
    layers: list[tuple[Floats, Floats]] = []
    mean, before = np.zeros(0), {}
    for node in nodes:
        before[node.output[0]] = node
        is_layer = node.op_type == "Gemm" and not node.attribute and len(node.input) == 3
        if not is_layer or not {node.input[0], node.input[2]} <= constants.keys():
            continue
        weights, bias = constants[node.input[0]], constants[node.input[2]]
        if bias.shape != (len(weights), 1):
            continue
        if not layers:
            mean = constants[before[node.input[1]].input[1]].reshape(-1)
        layers.append((weights, bias[:, 0]))
    return layers, mean


def _box(graph: Any, constants: Mapping[str, Floats]) -> tuple[Floats, Floats]:
    """Least and largest features (f,), from the test of their distance from the middle."""
    before = {node.output[0]: node for node in graph.node}
    for node in graph.node:
        half = constants.get(node.input[1]) if node.op_type == "LessOrEqual" else None
        if half is not None and half.ndim == 2:
            middle = constants[before[before[node.input[0]].input[0]].input[1]]
            width = half / (1.0 + 2.0 * BOX_TOLERANCE)
            return (middle - width).reshape(-1), (middle + width).reshape(-1)
    raise ModelFileError("the graph does not test the range of its features")
