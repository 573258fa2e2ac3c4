"""What the runtime reads from the metadata of a model file.

A checksum can be made anew by whoever changes a file: it shows damage, not whether a file is right.
Hence every entry that is shown or computed with is checked here, once for all that read it.
"""

from __future__ import annotations

import json
import math
import unicodedata
from collections.abc import Container, Mapping
from typing import Any

import numpy as np

from soilml.onboard.features import READABLE
from soilml.onboard.gaussian_product import PriorSummary
from soilml.onboard.held_out_errors import HeldOutErrors
from soilml.onboard.set_contract import INFERRED, MODEL_ERROR_INPUT
from soilml.onboard.set_posterior import SetPosterior
from soilml.quantities import QUANTITIES

#: Keys of an output's prior in the metadata, in the order of `PriorSummary`.
_PRIOR = ("prior_mean", "prior_std", "lower", "upper")


def read_fields(metadata: Mapping[str, str]) -> dict[str, Any]:
    """Fields of an `Estimator` from the metadata of its file, by field name.

    Raises one of `model_file.DAMAGED` where an entry is missing or malformed.
    """
    inputs = _read_quantities(metadata, "inputs", READABLE)
    outputs = _read_quantities(metadata, "outputs", QUANTITIES)
    _check_provenance(metadata)
    for entry in outputs:
        mean, std, lower, upper = (entry[key] for key in _PRIOR)
        if not (all(map(_is_number, (mean, std, lower, upper))) and std > 0.0 and lower < upper):
            raise ValueError("outputs: a prior that is none")
    together = json.loads(metadata["together"])
    factor = np.asarray(together["alone"], np.float64).reshape(-1)
    sets = SetPosterior.of(json.loads(metadata["set"])) if "set" in metadata else None
    if sets is not None:
        _check_set(sets)
    if not all(is_plain_name(entry["scale"]) for entry in outputs if "scale" in entry):
        raise ValueError("outputs: a scale that is no plain text")
    per_row = tuple(entry["name"] for entry in outputs if entry.get("per_row", False))
    alone = sets is not None and sets.sets_only  # without estimates of single rows
    if factor.size != len(outputs) and not alone:
        raise ValueError("together: not of these outputs")
    return {
        "inputs": tuple(entry["name"] for entry in inputs),
        "names": tuple(entry["name"] for entry in outputs),
        "units": tuple(entry["unit"] for entry in outputs),
        "per_row": per_row,
        "metadata": dict(metadata),
        "prior": read_prior(metadata, {}),
        "coverage_factor": factor,
        "errors": HeldOutErrors.of(together["held_out"]) if "held_out" in together else None,
        "sets": sets,
    }


def read_prior(metadata: Mapping[str, str], context: Mapping[str, float]) -> PriorSummary:
    """The prior of the outputs, where need be scaled by the context value that an output names."""
    outputs = json.loads(metadata["outputs"])
    scale = np.asarray([context.get(entry.get("scale", ""), 1.0) for entry in outputs])
    return PriorSummary(
        *(scale * np.asarray([entry[key] for entry in outputs], np.float64) for key in _PRIOR)
    )


def read_probe(metadata: Mapping[str, str]) -> list[dict[str, Any]]:
    """Readings with the answers that the file must reproduce.

    Raises `KeyError`, `TypeError` or `ValueError` where there are none.
    """
    probe = json.loads(metadata["probe"])
    if not (isinstance(probe, list) and probe):
        raise ValueError("no probe")
    # a graph without sets under metadata that promise them would fail where a set is estimated
    if "set" in metadata and all(entry.get("given") is None for entry in probe):
        raise ValueError("no probe of a set")
    return probe


def _read_quantities(
    metadata: Mapping[str, str], key: str, known: Container[str]
) -> list[dict[str, Any]]:
    """The entries of inputs or outputs: known quantities, each once, in their SI units."""
    entries: list[dict[str, Any]] = json.loads(metadata[key])
    names = [entry["name"] for entry in entries]
    if not (names and all(name in known for name in names) and len({*names}) == len(names)):
        raise ValueError(f"{key}: names that are not known")
    if any(entry["unit"] != QUANTITIES[entry["name"]].unit for entry in entries):
        raise ValueError(f"{key}: a unit that is not that of the quantity")
    return entries


def _check_set(sets: SetPosterior) -> None:
    errors = sets.common_errors.items()
    sizes = [size for name, size in errors if (name, size) != (MODEL_ERROR_INPUT, INFERRED)]
    parts = [*sets.noise.values(), *((size, 0.0) for size in sizes)]
    if not all(math.isfinite(part) and part >= 0.0 for pair in parts for part in pair):
        raise ValueError("set: noise or an error that is no number, zero or more")
    ranges = sets.context_ranges.items()
    if not all(
        is_plain_name(k) and -math.inf < low <= high < math.inf for k, (low, high) in ranges
    ):
        raise ValueError("set: the range of a context input")


def _check_provenance(metadata: Mapping[str, str]) -> None:
    """Raise where gear, recipe or spec in the metadata is malformed.

    The runtime does not use them; commands show them, and compare them with a user's model file.
    """
    gear, recipe = json.loads(metadata["gear"]), json.loads(metadata["recipe"])
    sizes = [gear[name] for name in ("radius", "width") if name in gear]
    if not all(_is_number(size) and size > 0.0 for size in sizes):
        raise ValueError("gear: a size that is no number above zero")
    texts = [value for value in gear.values() if not _is_number(value)]
    if not all(map(is_plain_name, [*texts, gear.get("type", "none")])):
        raise ValueError("gear: a value that is neither a number nor a plain text")
    if not all(is_plain_name(effect["name"]) for effect in recipe.get("effect", [])):
        raise ValueError("recipe: the name of an effect is no plain text")
    if not all(
        isinstance(entry, dict) for entry in json.loads(metadata["spec"]).get("regressor", [])
    ):
        raise ValueError("spec: a regressor that is no table")


def _is_number(value: Any) -> bool:
    """Whether a value of JSON is a finite number."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def is_plain_name(value: Any) -> bool:
    """Whether a value of JSON is a text of which every character is shown as itself."""
    return (
        isinstance(value, str)
        and value != ""
        and all(c.isprintable() or unicodedata.category(c) == "Zs" for c in value)
    )
