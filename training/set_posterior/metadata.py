"""What a file says of its set posterior: for the board, for its probe, for its card."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from soilml.onboard.set_contract import ABSENT_STD, RESPONSE_CHANNELS
from training.set_posterior.credible_interval import INTERVAL
from training.set_posterior.graph import SetPosteriorGraph
from training.set_posterior.validation import SetFigures, graph_outputs, posterior_session

#: Rows of the set that the board tries when it loads a file.
PROBED = 8


def metadata_of(
    posterior: SetPosteriorGraph, noise: Mapping[str, Any], alone: bool
) -> dict[str, Any]:
    """For the board: terms of the system, noise by channel, what must be given, and its range."""
    return {
        "terms": len(posterior.response.terms),
        "noise": dict(noise),
        "context": posterior.family.limits(),
        "alone": alone,
        "error": dict(zip(RESPONSE_CHANNELS, posterior.response.error.tolist(), strict=True)),
        "interval": list(INTERVAL),
        "misfit": {
            "readings": posterior.limits.readings.tolist(),
            "most": posterior.limits.misfit.tolist(),
        },
        **posterior.family.metadata(),
    }


def probe_of_sets(posterior: SetPosteriorGraph | None) -> list[dict[str, Any]]:
    """A set with the answer that it must get; nothing where the file has no set posterior."""
    if posterior is None:
        return []
    sets = posterior.family.sets(16, PROBED, 5)
    session = posterior_session(posterior)
    for index in range(len(sets.truth)):
        rows = {k: v.astype(np.float32).astype(np.float64) for k, v in sets.rows(index).items()}
        found = graph_outputs(session, posterior.response, sets, index)
        if found["set_in_range"][0] and (rows["sinkage_std"] == ABSENT_STD).all():
            break
    names = ("slip", "torque", "load", "torque_std", "torque_bias")
    return [
        {
            "readings": {name: rows[name].tolist() for name in names},
            "given": sets.context_of(index),
            "mean": found["set_mean"].tolist(),
            "std": found["set_std"].tolist(),
            "in_range": True,
        }
    ]


def figures_of(figures: Mapping[int, SetFigures]) -> dict[str, Any]:
    """Figures by rows of a set."""
    return {
        str(rows): {
            "sets": own.sets,
            "rmse_share_of_prior": own.relative.tolist(),
            "cover90": own.cover90.tolist(),
            "joint90": own.joint90,
            "refused": own.refused,
        }
        for rows, own in figures.items()
    }


def table_of(figures: Mapping[int, SetFigures], names: list[str]) -> list[str]:
    """The same as a table for the card."""
    head = " | ".join(f"{what} {n}" for what in ("error", "90 %") for n in names)
    lines = [f"| rows | sets | {head} | joint 90 % | refused |"]
    lines.append("|---:|---:|" + "---:|" * (2 * len(names) + 2))
    for rows, own in figures.items():
        cells = [f"{v:.3f}" for v in own.relative] + [f"{v:.1%}" for v in own.cover90]
        cells += [f"{own.joint90:.1%}", f"{own.refused:.1%}"]
        lines.append(f"| {rows} | {own.sets} | {' | '.join(cells)} |")
    return [*lines, ""]
