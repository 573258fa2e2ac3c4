"""Model files written anew around the response surface that they have, without training it again.

For files whose response stays as it is while the rest of the graph of a set posterior changes:
`python exported/make.py --graphs NAME ...` also measures limits and accuracy again, for the card.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
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
from training.regressors.gaussian_regressor import Standardisation
from training.set_posterior.error_scales import USUAL_SCALES, ErrorScales
from training.set_posterior.families.dimensionless_family import DimensionlessFamily
from training.set_posterior.families.recipe_family import RecipeFamily
from training.set_posterior.families.wheel_family import WheelFamily
from training.set_posterior.graph import SetPosteriorGraph
from training.set_posterior.monomials import Terms
from training.set_posterior.posterior_summary import MisfitLimits
from training.set_posterior.residual_system import BOX_TOLERANCE
from training.set_posterior.response_surface import Response, family_terms
from training.set_posterior.validation import (
    Progress,
    figures_of,
    metadata_of,
    probe_of_sets,
    table_of,
    validate_posterior,
    with_misfit_limits,
)

CHANNELS = len(RESPONSE_CHANNELS)


def write_anew(path: Path, progress: Progress | None = None) -> None:
    """Write the set posterior of a model file anew; estimates of single rows stay as they are.

    progress: With it, the limits of the misfit and the accuracy on simulated sets are measured
        again, and replace those in the file and in its card.

    Raises `ModelFileError` for a file without a set posterior, or one of another structure.
    """
    import onnx

    model = onnx.load(path)
    metadata = {entry.key: entry.value for entry in model.metadata_props}
    if "set" not in metadata:
        raise ModelFileError(f"{path} has no set posterior")
    posterior = _stored_posterior(model, metadata, path)
    changed: dict[str, str] = {}
    if progress is not None:
        posterior = with_misfit_limits(posterior, progress)
        figures = validate_posterior(posterior, progress)
        changed["metrics_of_posterior"] = json.dumps(figures_of(figures))
        names = [entry["name"] for entry in json.loads(metadata["outputs"])]
        card = path.with_suffix(".md")
        tables = table_of(figures, names)[:-1], posterior.scales.for_card()
        text = _with_tables(card.read_text(encoding="utf-8"), tables)
        card.write_text(text, encoding="utf-8")
    alone = json.loads(metadata["set"])["alone"]
    graph = Graph("" if alone else "sets_")
    posterior.add_to(graph, "" if alone else "sets_")
    if alone:
        for name, value in posterior.defaults().items():
            graph.default(name, value)
        found = graph.model(posterior.inputs, posterior.outputs)
    else:
        found = _beside_single_rows(model, graph, posterior)
    probe = [one for one in json.loads(metadata["probe"]) if "given" not in one]
    changed |= {
        "soilml_interface": INTERFACE,
        "set": json.dumps(metadata_of(posterior, sets_only=alone)),
        "probe": json.dumps([*probe, *probe_of_sets(posterior)]),
    }
    write_model(found, metadata | changed, path)


def _stored_posterior(model: Any, metadata: Mapping[str, str], path: Path) -> SetPosteriorGraph:
    """The set posterior of a file, with the response that it has."""
    sets = json.loads(metadata["set"])
    family = _family(metadata, sets, path)
    branch = model.graph
    if not sets["alone"]:
        branch = next(a.g for a in branch.node[0].attribute if a.name == "then_branch")
    limits = MisfitLimits(*(np.asarray(sets["misfit"][key]) for key in ("readings", "most")))
    terms = tuple(tuple(term) for term in sets.get("monomials", ())) or family_terms(family)
    response = read_response(branch, family, sets["error"], terms)
    response = replace(response, carried=float(sets.get("carried", 1.0)))
    stated = json.loads(metadata["spec"]).get("set_posterior", {})
    scales = USUAL_SCALES
    if "model_errors" in stated:
        scales = ErrorScales.of_list(stated["model_errors"])
    errors = {name: float(std) for name, std in stated.get("sensor_errors", {}).items()}
    small = bool(sets.get("small", False))
    return SetPosteriorGraph(family, response, limits, sets["noise"], small, scales, errors)


def _with_tables(card: str, tables: Sequence[Sequence[str]]) -> str:
    """A card with the Markdown tables that have the heads of these, replaced by them."""
    lines = card.split("\n")
    for table in tables:
        rows = [line for line in table if line.startswith("|")]
        first = lines.index(rows[0])
        end = next(i for i in range(first, len(lines)) if not lines[i].startswith("|"))
        lines[first:end] = rows
    return "\n".join(lines)


def _family(metadata: Mapping[str, str], sets: Mapping[str, Any], path: Path) -> WheelFamily:
    """The family of wheels that a file was trained for, from the recipe or spec in its metadata."""
    if sets["alone"]:
        ranges = json.loads(metadata["spec"])["any_wheel"]
        return DimensionlessFamily.take(Settings(ranges, "[any_wheel]"))
    targets = [entry["name"] for entry in json.loads(metadata["outputs"])]
    return RecipeFamily.of(parse_recipe(metadata["recipe"], str(path)), targets)


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
    del changed.functions[:], changed.opset_import[1:]
    changed.functions.extend(sets.functions.values())
    changed.opset_import.extend(helper.make_opsetid(*one) for one in sets.opsets[1:])
    del changed.graph.initializer[:]
    for name, value in (defaults | {SET_SWITCH: np.zeros(1, bool)}).items():
        changed.graph.initializer.append(numpy_helper.from_array(np.asarray(value), name))
    for entry in changed.graph.input:
        sizes = posterior.inputs.get(entry.name, [])
        for dimension, size in zip(entry.type.tensor_type.shape.dim, sizes, strict=False):
            if isinstance(size, int):
                dimension.dim_value = size
    checker.check_model(changed, full_check=True)
    return changed


def read_response(
    graph: Any, family: WheelFamily, error: Mapping[str, float], terms: Terms
) -> Response:
    """The response surface in the graph of a set posterior, by the names of its constants.

    Raises `ModelFileError` for a graph of an earlier version, which lacks these names.
    """
    from onnx import numpy_helper

    found = {
        c.name.removeprefix("sets_"): numpy_helper.to_array(c).astype(np.float64)
        for c in graph.initializer
    }
    if "response_last" not in found:
        raise ModelFileError("the file is of an earlier version: train it again")
    whole = found["response_last"]  # its last columns subtract the readings
    inner = _layers(found, "response")
    last = (whole[:, : len(inner[-2].T)].T, found["response_last_bias"][:, 0])
    middle = found["range_middle"][:, 0]
    width = found["range_half"][:, 0] / (1.0 + 2.0 * BOX_TOLERANCE)
    mean = found["response_mean"][:, 0]
    scaling = Standardisation(mean, np.ones_like(mean))
    errors = np.asarray([error[name] for name in RESPONSE_CHANNELS])
    response = Response(terms, scaling, (*inner, *last), middle - width, middle + width, errors)
    if not family.model_errors()["contact"]:
        return response
    by_channel = found["contact_last"].reshape(CHANNELS, -1, len(terms)).transpose(1, 2, 0)
    flat = by_channel.reshape(len(by_channel), -1)
    mean = found["contact_mean"][:, 0]
    layers = (*_layers(found, "contact"), flat[:-1], flat[-1])
    scaling = Standardisation(mean, np.ones_like(mean))
    contact = replace(response, scaling=scaling, layers=layers, error=np.zeros(CHANNELS))
    return replace(response, contact=contact)


def _layers(found: Mapping[str, Floats], name: str) -> tuple[Floats, ...]:
    """Weights (inputs, units) and biases (units,) of the two hidden layers."""
    return tuple(
        layer
        for k in range(2)
        for layer in (found[f"{name}_weights_{k}"].T, found[f"{name}_bias_{k}"][:, 0])
    )
