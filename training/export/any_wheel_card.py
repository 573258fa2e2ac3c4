"""The model card of the file for wheels of any size."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from soilml import __version__
from soilml.quantities import SHEAR
from training.onnx_graph.builder import IR_VERSION, OPSET
from training.set_posterior.metadata import table_of
from training.set_posterior.validation import SetFigures


def any_wheel_card(
    metadata: Mapping[str, str], units: Mapping[str, str], figures: Mapping[int, SetFigures]
) -> str:
    """The card as Markdown, from metadata, units of the file's own inputs, and set metrics."""
    sets = json.loads(metadata["set"])
    error, pressure, sinkage = sets["error"], sets["ground_pressure"], sets["sinkage_over_radius"]
    noise = {
        name: f"{100 * share:g} % + {constant:g}"
        for name, (constant, share) in sets["noise"].items()
    }
    lines = [
        "# any_wheel",
        "",
        "Estimates cohesion, friction angle and shear modulus from one or many readings of slip, "
        "torque and load, and of sinkage and drawbar pull where they are measured, for a rigid "
        "wheel of any size: wheel, bearing values, noise and upper bounds of the prior are inputs.",
        "",
        "    estimator = Estimator.load('any_wheel.onnx').on(wheel_radius=0.15, ...)",
        "    estimator.run(slip=..., torque=..., load=...)",
        "",
        "The exact likelihood of all readings under a learned response of the wheel is sampled in "
        "the graph; the posterior itself is not learned. Bearing values: the pressure is "
        "bearing_modulus z^n, with bearing_modulus = kc / b + kphi; bearing_std is the standard "
        "deviation of its logarithm at a sinkage of r / 20, and four times that of n. theta_m / "
        "theta_1 is 0.4 + 0.15 s. The prior is uniform: cohesion from 0 to cohesion_max, friction "
        "angle from 25 to 45 degrees, shear modulus from shear_modulus_max / 6 to "
        "shear_modulus_max.",
        "",
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
        "std; 90 % is the coverage of the 90 % interval; refused sets count with the prior.",
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
