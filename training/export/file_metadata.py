"""The metadata of a model file trained from data."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
from typing import Any

from soilml import __version__
from soilml.config.model_settings import take_gear
from soilml.io.toml_settings import Settings
from soilml.onboard.metadata.pooling_entry import write_pooling
from soilml.onboard.model_file import FORMAT
from soilml.onboard.set_contract import INTERFACE
from soilml.quantities import QUANTITIES
from training.data.targets import PER_ROW
from training.onnx_graph.builder import IR_VERSION, OPSET
from training.set_posterior.graph import SetPosteriorGraph
from training.set_posterior.metadata import figures_of, metadata_of
from training.train import TrainedModel


def file_metadata(
    trained: TrainedModel,
    probe: list[dict[str, Any]],
    parity: float,
    data_path: str | os.PathLike[str],
) -> dict[str, str]:
    """Metadata of a model file: what the runtime needs, provenance and metrics; values are JSON."""
    spec, data = trained.spec, trained.data
    recipe = data.recipe
    inputs = [
        {
            "name": name,
            "column": QUANTITIES[name].column,
            "unit": QUANTITIES[name].unit,
            "lower": float(values.min()),
            "upper": float(values.max()),
        }
        for name, values in trained.parts.train.measured.items()
    ]
    outputs = [
        {
            "name": name,
            "column": QUANTITIES[name].column,
            "unit": QUANTITIES[name].unit,
            "lower": float(data.lower[k]),
            "upper": float(data.upper[k]),
            "prior_mean": float(trained.prior.mean[k]),
            "prior_std": float(trained.prior.std[k]),
            **({"per_row": True} if name in PER_ROW else {}),
        }
        for k, name in enumerate(spec.targets)
    ]
    return {
        "soilml_format": FORMAT,
        "soilml_interface": INTERFACE,
        "soilml_version": __version__,
        "inputs": json.dumps(inputs),
        "outputs": json.dumps(outputs),
        "gear": json.dumps(_gear_in_si(json.loads(recipe).get("gear", {})), sort_keys=True),
        "together": json.dumps(write_pooling(trained.pooling)),
        "probe": json.dumps(probe),
        **_set_metadata(trained.set_posterior),
        "spec": spec.text,
        "recipe": recipe,
        "recipe_sha256": hashlib.sha256(recipe.encode()).hexdigest(),
        "data_sha256": _data_digest(Path(data_path)),
        "metrics": json.dumps(
            {
                name: {
                    "rmse": score.rmse.tolist(),
                    "rmse_share_of_prior": score.relative.tolist(),
                    "nll": score.nll.tolist(),
                    "cover50": score.cover50.tolist(),
                    "cover90": score.cover90.tolist(),
                    "rows": score.rows,
                }
                for name, score in trained.scores.items()
            }
        ),
        "metrics_of_posterior": json.dumps(figures_of(trained.set_figures)),
        "metrics_of_sets": json.dumps(
            {
                label: {
                    length: {
                        "rmse_share_of_prior": score.relative.tolist(),
                        "cover90": score.cover90.tolist(),
                        "sets": score.rows,
                    }
                    for length, score in scores.items()
                }
                for label, scores in trained.pooled_scores.items()
            }
        ),
        "parity": f"{parity:.3e}",
        "opset": str(OPSET),
        "ir_version": str(IR_VERSION),
    }


def _gear_in_si(entry: dict[str, Any]) -> dict[str, Any]:
    """The gear of a recipe, with numbers for values that have a unit, such as "150 mm"."""
    if not entry:
        return {}
    made = take_gear(Settings(dict(entry), "[gear]", Path()))
    return {
        name: getattr(made, name, value) if isinstance(value, str) else value
        for name, value in entry.items()
    }


def _set_metadata(posterior: SetPosteriorGraph | None) -> dict[str, str]:
    """The entry "set" of a set posterior."""
    if posterior is None:
        return {}
    return {"set": json.dumps(metadata_of(posterior, sets_only=False))}


def _data_digest(path: Path) -> str:
    """SHA-256 of a data file, or of the files of a folder one after the other."""
    digest = hashlib.sha256()
    for file in sorted(path.glob("*.parquet")) if path.is_dir() else [path]:
        with file.open("rb") as opened:
            while block := opened.read(1 << 20):
                digest.update(block)
    return digest.hexdigest()
