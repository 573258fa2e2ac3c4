"""Metadata, probe and figures of a set posterior, for its file and its card."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from soilml.onboard.set_contract import ABSENT_STD, COMMON_ERROR_INPUTS, RESPONSE_CHANNELS
from training.set_posterior.graph import SetPosteriorGraph
from training.set_posterior.sampler.credible_interval import INTERVAL
from training.set_posterior.validation import SetFigures, graph_outputs, posterior_session

#: Rows of the probe, and the sets among which the first suitable one is taken.
PROBE_ROWS, PROBE_CANDIDATES, PROBE_SEED = 8, 16, 5


def metadata_of(posterior: SetPosteriorGraph, sets_only: bool) -> dict[str, Any]:
    """The entry `set` of the metadata; the runtime reads terms to alone."""
    return {
        "terms": len(posterior.response.terms),
        "noise": {name: list(parts) for name, parts in posterior.noise.items()},
        "context": posterior.family.limits(),
        "errors": posterior.family.usual_errors(),
        "model_errors": posterior.family.model_errors(),
        "alone": sets_only,
        "error": dict(zip(RESPONSE_CHANNELS, posterior.response.error.tolist(), strict=True)),
        "interval": list(INTERVAL),
        "misfit": {
            "readings": posterior.limits.readings.tolist(),
            "most": posterior.limits.misfit.tolist(),
        },
        **posterior.family.metadata(),
    }


def probe_of_sets(posterior: SetPosteriorGraph | None) -> list[dict[str, Any]]:
    """A simulated set of torque readings with its estimate; none without a set posterior.

    The runtime repeats the estimate when it loads the file.
    """
    if posterior is None:
        return []
    sets = posterior.family.sets(PROBE_CANDIDATES, PROBE_ROWS, PROBE_SEED)
    session = posterior_session(posterior)
    for index in range(len(sets.truth)):
        rows = {k: v.astype(np.float32).astype(np.float64) for k, v in sets.rows(index).items()}
        outputs = graph_outputs(session, posterior.response, sets, index)
        if outputs["set_in_range"][0] and (rows["sinkage_std"] == ABSENT_STD).all():
            break
    names = ("slip", "torque", "load", "torque_std", "torque_bias")
    return [
        {
            "readings": {name: rows[name].tolist() for name in names},
            "given": sets.context_of(index) | dict.fromkeys(COMMON_ERROR_INPUTS, 0.0),
            "mean": outputs["set_mean"].tolist(),
            "std": outputs["set_std"].tolist(),
            "in_range": True,
        }
    ]


def figures_of(figures: Mapping[int, SetFigures]) -> dict[str, Any]:
    """Accuracy by rows of a set, as the metadata have it."""
    return {
        str(rows): {
            "sets": accuracy.sets,
            "rmse_share_of_prior": accuracy.relative.tolist(),
            "cover90": accuracy.cover90.tolist(),
            "joint90": accuracy.joint90,
            "refused": accuracy.refused,
        }
        for rows, accuracy in figures.items()
    }


def table_of(figures: Mapping[int, SetFigures], names: list[str]) -> list[str]:
    """Accuracy by rows of a set as a Markdown table, for the card."""
    head = " | ".join(f"{what} {n}" for what in ("error", "90 %") for n in names)
    lines = [f"| rows | sets | {head} | joint 90 % | refused |"]
    lines.append("|---:|---:|" + "---:|" * (2 * len(names) + 2))
    for rows, accuracy in figures.items():
        columns = [f"{v:.3f}" for v in accuracy.relative] + [f"{v:.1%}" for v in accuracy.cover90]
        columns += [f"{accuracy.joint90:.1%}", f"{accuracy.refused:.1%}"]
        lines.append(f"| {rows} | {accuracy.sets} | {' | '.join(columns)} |")
    return [*lines, ""]
