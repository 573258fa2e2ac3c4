"""One file for wheels of any size: trained on what is simulated, from a spec with [any_wheel]."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from datagen.recipe import packaged_file
from soilml import __version__
from soilml.config.measurement_noise import take_noise
from soilml.io.toml_settings import read_settings
from soilml.onboard.model_file import FORMAT
from soilml.onboard.set_contract import RESPONSE_CHANNELS
from soilml.quantities import QUANTITIES, SHEAR, column
from training.export.model_file import write_model
from training.onnx_graph.builder import IR_VERSION, OPSET, Graph
from training.set_posterior.dimensionless_family import DimensionlessFamily
from training.set_posterior.graph import SetPosteriorGraph
from training.set_posterior.metadata import figures_of, metadata_of, probe_of_sets, table_of
from training.set_posterior.posterior_summary import prior_summary
from training.set_posterior.response_surface import ResponseSettings, fit_response
from training.set_posterior.settings import take_response_settings
from training.set_posterior.validation import (
    SetFigures,
    calibrate_misfit_limits,
    validate_posterior,
)

Progress = Callable[[str, int, int], None]

#: Each output's scale: the input that it is a share of.
SCALES = {"cohesion": "cohesion_max", "shear_modulus": "shear_modulus_max"}
#: A file without regressors of single rows joins nothing by them.
NO_JOINING: dict[str, Any] = {
    "over": [],
    "lower": [],
    "upper": [],
    "std": [],
    "kinds": [],
    "alone": [1.645] * len(SHEAR),
    "doubt": [],
}


@dataclass(frozen=True)
class AnySpec:
    """What is to be learned of which wheels, and the noise that the file takes for given."""

    family: DimensionlessFamily
    size: ResponseSettings
    noise: dict[str, list[float]]
    text: str


def is_for_any_wheel(path: str | os.PathLike[str]) -> bool:
    """Whether a spec has [any_wheel]."""
    return "any_wheel" in read_settings(packaged_file(path, "training", "specs"))


def read_any_spec(path: str | os.PathLike[str]) -> AnySpec:
    """The spec in a TOML file, or a packaged one by name; raises `InputError` naming the key."""
    settings = read_settings(packaged_file(path, "training", "specs"))
    text = json.dumps(settings.content, sort_keys=True)
    seed = int(settings.take("seed", int, "a whole number, 0 or more", 0))
    family = DimensionlessFamily.take(settings.table("any_wheel"))
    own, noise = settings.table("noise"), {}
    for name in RESPONSE_CHANNELS:
        taken = take_noise(own, column(name))
        noise[name] = [taken.constant, taken.share]
    own.finish()
    bias = settings.table("bias")
    if column("torque") in bias:
        taken = take_noise(bias, column("torque"))
        noise["torque_bias"] = [taken.constant, taken.share]
    bias.finish()
    size = take_response_settings(settings, seed)
    settings.finish()
    return AnySpec(family, size, noise, text)


def trained(spec: AnySpec, progress: Progress) -> tuple[SetPosteriorGraph, dict[int, SetFigures]]:
    """The set posterior and its figures on fresh sets."""
    posterior = calibrate_misfit_limits(
        spec.family, fit_response(spec.family, spec.size, progress), progress
    )
    return posterior, validate_posterior(posterior, progress)


def export(
    spec: AnySpec,
    posterior: SetPosteriorGraph,
    figures: dict[int, SetFigures],
    path: str | os.PathLike[str],
) -> dict[str, str]:
    """Write the file and return its metadata; bytes depend on the spec alone."""
    graph = Graph()
    posterior.add_to(graph)
    prior = prior_summary(posterior.family)
    columns = []
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
        columns.append(entry | ({"scale": SCALES[name]} if name in SCALES else {}))
    metadata = {
        "soilml_format": FORMAT,
        "soilml_version": __version__,
        "inputs": json.dumps(
            [
                {"name": name, "column": column(name), "unit": QUANTITIES[name].unit}
                for name in ("slip", "torque", "load")
            ]
        ),
        "outputs": json.dumps(columns),
        "gear": json.dumps({"type": "wheel"}),
        "together": json.dumps(NO_JOINING),
        "set": json.dumps(metadata_of(posterior, spec.noise, alone=True)),
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


def card(
    metadata: dict[str, str], posterior: SetPosteriorGraph, figures: dict[int, SetFigures]
) -> str:
    """The card as Markdown."""
    said = json.loads(metadata["set"])
    context, units = said["context"], posterior.family.inputs()
    error = said["error"]
    noise = {
        name: f"{100 * share:g} % + {constant:g}"
        for name, (constant, share) in said["noise"].items()
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
        f"Slip {_span(said['slip'])}; load {_span(said['load'])} N; load / (radius width) "
        f"{said['ground_pressure'][0]:g} to {said['ground_pressure'][1]:g} Pa; sinkage / radius "
        f"{said['sinkage_over_radius'][0]:g} to {said['sinkage_over_radius'][1]:g} on soil in the "
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


def _span(setting: Any) -> str:
    low, high = setting["range"] if isinstance(setting, dict) else setting
    return f"{low:g} to {high:g}"
