"""Model file and card for wheels of any size, which have a set posterior only."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from soilml import __version__
from soilml.onboard.held_out_errors import together
from soilml.onboard.model_file import FORMAT
from soilml.onboard.set_contract import INTERFACE
from soilml.quantities import QUANTITIES, SHEAR, Z_90, column
from training.export.model_file import write_model
from training.onnx_graph.builder import IR_VERSION, OPSET, Graph
from training.set_posterior.error_scales import ErrorScales
from training.set_posterior.graph import SetPosteriorGraph
from training.set_posterior.posterior_summary import prior_summary
from training.set_posterior.validation import (
    SetFigures,
    figures_of,
    metadata_of,
    probe_of_sets,
    table_of,
)
from training.spec import AnyWheelSpec

#: The input that the prior of an output scales with.
SCALES = {"cohesion": "cohesion_max", "shear_modulus": "shear_modulus_max"}
#: What a card says of a file for a microcontroller.
SMALL = (
    "For a microcontroller: the response has fewer monomials and a smaller network, and fewer "
    "points are sampled."
)


def export_any_wheel(
    spec: AnyWheelSpec,
    posterior: SetPosteriorGraph,
    figures: dict[int, SetFigures],
    path: str | os.PathLike[str],
) -> dict[str, str]:
    """Write the file and return its metadata; its bytes depend on the spec only."""
    posterior = replace(posterior, noise=spec.noise)
    graph = Graph()
    posterior.add_to(graph)
    for name, value in posterior.defaults().items():
        graph.default(name, value)
    prior = prior_summary(posterior.family)
    outputs = []
    for k, (name, axis) in enumerate(zip(SHEAR, posterior.family.axes, strict=False)):
        entry = {
            "name": name,
            "column": column(name),
            "unit": QUANTITIES[name].unit,
            "lower": axis.ends[0],
            "upper": axis.ends[1],
            "prior_mean": float(prior["mean"][k]),
            "prior_std": float(prior["std"][k]),
        }
        outputs.append(entry | ({"scale": SCALES[name]} if name in SCALES else {}))
    metadata = {
        "soilml_format": FORMAT,
        "soilml_interface": INTERFACE,
        "soilml_version": __version__,
        "inputs": json.dumps(
            [
                {"name": name, "column": column(name), "unit": QUANTITIES[name].unit}
                for name in ("slip", "torque", "load")
            ]
        ),
        "outputs": json.dumps(outputs),
        "gear": json.dumps({"type": "wheel"}),
        "together": json.dumps(together(np.full(len(SHEAR), round(Z_90, 3)))),
        "set": json.dumps(metadata_of(posterior, sets_only=True)),
        "probe": json.dumps(probe_of_sets(posterior)),
        "spec": spec.text,
        "spec_sha256": hashlib.sha256(spec.text.encode()).hexdigest(),
        "recipe": "{}",
        "metrics_of_posterior": json.dumps(figures_of(figures)),
        "opset": str(OPSET),
        "ir_version": str(IR_VERSION),
    }
    write_model(graph.model(posterior.inputs, posterior.outputs), metadata, path)
    return metadata


def any_wheel_card(
    metadata: Mapping[str, str],
    units: Mapping[str, str],
    figures: Mapping[int, SetFigures],
    name: str,
) -> str:
    """The card as Markdown, from metadata, units of the file's own inputs, and set metrics."""
    sets = json.loads(metadata["set"])
    error, pressure, sinkage = sets["error"], sets["ground_pressure"], sets["sinkage_over_radius"]
    noise = {
        name: f"{100 * share:g} % + {constant:g}"
        for name, (constant, share) in sets["noise"].items()
    }
    lines = [
        f"# {name}",
        "",
        "Estimates cohesion, friction angle and shear modulus from one or many readings of slip, "
        "torque and load, and of sinkage and drawbar pull where they are measured, for a rigid "
        "wheel of any size: wheel, bearing values, noise and upper bounds of the prior are inputs.",
        "",
        f"    estimator = Estimator.load('{name}.onnx').on(wheel_radius=0.15, ...)",
        "    estimator.run(slip=..., torque=..., load=...)",
        "",
        "The exact likelihood of all readings under a learned response of the wheel is sampled in "
        "the graph; the posterior itself is not learned. Uncertain bearing values are integrated "
        "out as errors that all rows share. Bearing values: the pressure is "
        "bearing_modulus z^n, with bearing_modulus = kc / b + kphi; bearing_std is the standard "
        "deviation of its logarithm at a sinkage of r / 20, and four times that of n. theta_m / "
        "theta_1 is 0.4 + 0.15 s. The prior is uniform: cohesion from 0 to cohesion_max, friction "
        "angle from 25 to 45 degrees, shear modulus from shear_modulus_max / 6 to "
        "shear_modulus_max.",
        "",
        *([SMALL, ""] if sets.get("small") else []),
        "## Valid for",
        "",
        "| input | unit | from | to |",
        "|---|---|---:|---:|",
        *[
            f"| `{name}` | {units[name]} | {low:.4g} | {high:.4g} |"
            for name, (low, high) in sets["context"].items()
        ],
        "",
        f"Slip {_range(sets['slip'])}; load {_range(sets['load'])} N; load / (radius width) "
        f"{_range(pressure)} Pa; sinkage / radius {_range(sinkage)} on soil in the middle of the "
        "prior. Rows outside these ranges have `in_range` false.",
        "",
        f"Default noise: {json.dumps(noise)}.",
        "",
        "## Figures",
        "",
        f"Error of the learned response, rms: torque {error['torque']:.2%}, sinkage "
        f"{error['sinkage']:.2%}, drawbar pull {error['drawbar_pull']:.2%} of the load.",
        "",
        "On fresh simulated sets: wheels, loads, soils and bearing values over their whole ranges, "
        "torque noise from 1 to 8 %; a third of the sets with a bias of the torque sensor, a third "
        "with a known bearing curve, a third with sinkage and drawbar pull. Error is RMSE / prior "
        "std; 90 % is the coverage of the 90 % interval; refused sets count with the prior. The "
        "model is taken as right there (`model_error` 0), as it is in the simulation; the file's "
        "own answer has errors of the model.",
        "",
        *table_of(figures, list(SHEAR)),
        *ErrorScales.of_list(sets["model_error_scales"]).for_card(),
        "",
        "## Made by",
        "",
        f"- spec sha256 `{metadata['spec_sha256']}`",
        f"- spec: `{metadata['spec']}`",
        f"- opset {OPSET}, IR {IR_VERSION}; soilml {metadata['soilml_version']}",
        "",
    ]
    return "\n".join(lines)


def _range(setting: Any) -> str:
    low, high = setting["range"] if isinstance(setting, dict) else setting
    return f"{low:g} to {high:g}"
