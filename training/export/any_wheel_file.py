"""Export of the model file for wheels of any size, which has a set posterior only."""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import replace

import numpy as np

from soilml import __version__
from soilml.onboard.gaussian_pooling import PoolingCalibration, RunConditions
from soilml.onboard.metadata.pooling_entry import write_pooling
from soilml.onboard.model_file import FORMAT
from soilml.onboard.set_contract import INTERFACE
from soilml.quantities import QUANTITIES, SHEAR, Z_90, column
from training.export.model_file import write_model
from training.onnx_graph.builder import IR_VERSION, OPSET, Graph
from training.set_posterior.graph import SetPosteriorGraph
from training.set_posterior.metadata import figures_of, metadata_of, probe_of_sets
from training.set_posterior.sampler.posterior_summary import prior_summary
from training.set_posterior.validation import SetFigures
from training.spec import AnyWheelSpec

#: The input that the prior of an output scales with.
SCALES = {"cohesion": "cohesion_max", "shear_modulus": "shear_modulus_max"}
NONE = np.zeros(0)
#: Pooling of a file without estimates of single rows: nothing is pooled.
NO_POOLING = PoolingCalibration(
    conditions=RunConditions((), NONE, NONE, NONE),
    patterns=(),
    single_row_coverage_factor=np.full(len(SHEAR), round(Z_90, 3)),
    inconsistency_limits=NONE,
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
        "together": json.dumps(write_pooling(NO_POOLING)),
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
