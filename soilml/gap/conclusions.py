"""Conclusions that a report does not support."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from soilml.fitting.least_squares import Solution
from soilml.gap.results import GapReport
from soilml.gap.statuses import STATUSES
from soilml.inference.posterior import Posterior
from soilml.remarks import Remark

#: Change of the readings by an effect of usual size, in sigma, from which it is visible on a known
#: soil, and what another soil leaves of it, below which it is not.
VISIBLE, UNSEEN = 6.0, 2.0
#: Share of the largest contribution to the other soil from which a parameter is stated.
NOTABLE = 0.3


def unsupported_conclusions(
    report: GapReport, naming_obstacles: Sequence[Remark], fixed: Sequence[str]
) -> list[Remark]:
    """Conclusions that the report does not support; `fixed` names parameters that were fixed."""
    found = [
        replace(obstacle, text=f"the cause of the gap: {obstacle}") for obstacle in naming_obstacles
    ]
    if report.status in ("no-gap", "undecided"):
        text = "that the model is complete: these runs merely show no disagreement"
        return [*found, Remark("model-complete", text)]
    found += STATUSES[report.status].unsupported
    if fixed:
        text = (
            f"that {', '.join(fixed)} in the model file are correct: they were fixed. An error in "
            "them appears as an effect: free them with a prior or with --free"
        )
        found.append(Remark("fixed-parameters", text, tuple(fixed)))
    text = "that a smaller gap proves a cause: wrong effects reduce the gap too"
    found.append(Remark("smaller-gap", text))
    if "held_out_region" in report.gap:
        region = report.gap["held_out_region"]
        if region.after > 0.5 * region.before and region.before > 1.5:
            text = f"extrapolation: on {region.description} the gap is hardly reduced"
            found.append(Remark("extrapolation", text))
    return found


def like_another_soil(posterior: Posterior, soil: Solution) -> list[Remark]:
    r"""The effects of usual size that a change of the soil imitates, by the parameters it takes.

    .. math:: \Delta x = (X^T V^{-1} X + P)^{-1} X^T V^{-1} s

    with the signature s, the Jacobian X of the soil and its prior precision P: what is left, in
    sigma, is the norm of :math:`s - X \Delta x`. References: omitted variables; Greene,
    Econometric Analysis, 7th ed., section 4.3.2.
    """
    soil = soil.whitened_by(posterior.whiten)
    alike: dict[tuple[str, ...], list[str]] = {}
    for s in posterior.signatures:
        whole = np.asarray(posterior.whiten @ s.column)
        change = np.linalg.solve(soil.information, soil.jacobian.T @ whole)
        left = float(np.linalg.norm(whole - soil.jacobian @ change))
        if float(np.linalg.norm(whole)) < VISIBLE or left >= UNSEEN:
            continue
        part = np.abs(change) * np.linalg.norm(soil.jacobian, axis=0)
        taken = [
            c.name.replace("_", " ")
            for c, own in zip(soil.coordinates, part, strict=True)
            if own >= NOTABLE * part.max()
        ]
        alike.setdefault(tuple(taken), []).append(s.name)
    remarks = []
    for parameters, names in alike.items():
        are, them = ("are", "them") if len(names) > 1 else ("is", "it")
        text = f"that {', '.join(names)} {are} absent: at usual size, these runs cannot tell {them}"
        text += f" from another {', '.join(parameters)}"
        remarks.append(Remark("like-another-soil", text, tuple(names)))
    return remarks


def like_another_force(posterior: Posterior, names: Sequence[str]) -> list[Remark]:
    """Of the effects of a cause, those that change the drawbar pull alone, where more was measured.

    Any force along the travel direction has such a signature, by whatever law it grows.
    """
    if len(posterior.terms.readings.channels) == 1:
        return []
    text = (
        "that {} is the force that is missing: it changes the drawbar pull alone, as the drag of a "
        "cable or of the carriage does"
    )
    return [
        Remark("like-another-force", text.format(name), (name,))
        for name in names
        if posterior.only_channel.get(name) == "drawbar_pull"
        and posterior.problem.effects[name].about.kind != "sensor"
    ]
