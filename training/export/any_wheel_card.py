"""The model card of the file for wheels of any size."""

from __future__ import annotations

import json
from typing import Any

from soilml import __version__
from soilml.quantities import SHEAR
from training.onnx_graph.builder import IR_VERSION, OPSET
from training.set_posterior.graph import SetPosteriorGraph
from training.set_posterior.metadata import table_of
from training.set_posterior.validation import SetFigures


def any_wheel_card(
    metadata: dict[str, str], posterior: SetPosteriorGraph, figures: dict[int, SetFigures]
) -> str:
    """The model card of the file for wheels of any size, as Markdown."""
    sets = json.loads(metadata["set"])
    context, units = sets["context"], posterior.family.inputs()
    error = sets["error"]
    noise = {
        name: f"{100 * share:g} % + {constant:g}"
        for name, (constant, share) in sets["noise"].items()
    }
    lines = [
        "# any_wheel",
        "",
        "Estimates cohesion, friction angle and shear modulus from one or many readings of slip, "
        "torque and load, with sinkage and drawbar pull where they are measured, of a rigid wheel "
        "of any size: wheel, bearing values, noise and the upper ends of the prior are inputs.",
        "",
        "    estimator = Estimator.load('any_wheel.onnx').on(wheel_radius=0.15, ...)",
        "    estimator.run(slip=..., torque=..., load=...)",
        "",
        "The exact likelihood of all readings under a learned response of the wheel is sampled in "
        "the graph; nothing is learned of the posterior itself. Bearing values: pressure is "
        "bearing_modulus z^n, with bearing_modulus = kc / b + kphi; bearing_std is the standard "
        "deviation of its logarithm at a sinkage of r / 20, and four times that of n. theta_m / "
        "theta_1 is 0.4 + 0.15 s. Cohesion is uniform from 0 to cohesion_max, friction angle from "
        "25 to 45 degrees, shear modulus from a sixth of shear_modulus_max to all of it.",
        "",
        "## Valid for",
        "",
        "| input | unit | from | to |",
        "|---|---|---:|---:|",
        *[f"| `{k}` | {units[k]} | {low:.4g} | {high:.4g} |" for k, (low, high) in context.items()],
        "",
        f"Slip {_range(sets['slip'])}; load {_range(sets['load'])} N; load / (radius width) "
        f"{sets['ground_pressure'][0]:g} to {sets['ground_pressure'][1]:g} Pa; sinkage / radius "
        f"{sets['sinkage_over_radius'][0]:g} to {sets['sinkage_over_radius'][1]:g} on soil in the "
        "middle of the prior. Rows outside come back out of range.",
        "",
        f"Noise where none is given: {json.dumps(noise)}.",
        "",
        "## Figures",
        "",
        f"Error of the learned response, rms: torque {error['torque']:.2%}, sinkage "
        f"{error['sinkage']:.2%}, drawbar pull {error['drawbar_pull']:.2%} of the load.",
        "",
        "On fresh sets: wheels, loads, soils and bearing over all of the range, torque noise 1 to "
        "8 %, in a third a bias of the torque sensor, in a third the bearing curve known, in a "
        "third sinkage and drawbar pull measured. Error is RMSE over the prior's standard "
        "deviation; a set that is refused counts with the prior.",
        "",
        *table_of(figures, list(SHEAR)),
        "## Made by",
        "",
        f"- spec sha256 `{metadata['spec_sha256']}`",
        f"- spec: `{metadata['spec']}`",
        f"- opset {OPSET}, IR {IR_VERSION}; soilml {__version__}",
        "",
    ]
    return "\n".join(lines)


def _range(setting: Any) -> str:
    low, high = setting["range"] if isinstance(setting, dict) else setting
    return f"{low:g} to {high:g}"
