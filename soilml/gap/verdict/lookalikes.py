"""What looks like an effect, or as an effect does: another soil, or a force outside of the law."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from soilml.fitting.least_squares import Solution
from soilml.inference.posterior import Posterior
from soilml.remarks import Remark

#: Change of the readings by an effect of usual size, in sigma, from which it is visible on a known
#: soil, and what another soil leaves of it, below which it is not.
VISIBLE, UNSEEN = 6.0, 2.0
#: Share of the largest contribution to the other soil from which a parameter is stated.
NOTABLE = 0.3
PULL = "drawbar_pull"


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
    return [
        Remark(
            "like-another-soil",
            f"that {', '.join(names)} {'are' if len(names) > 1 else 'is'} absent: at usual size, "
            f"these runs cannot tell {'them' if len(names) > 1 else 'it'} from another "
            f"{', '.join(parameters)}",
            tuple(names),
        )
        for parameters, names in alike.items()
    ]


def like_another_force(posterior: Posterior, names: Sequence[str]) -> list[Remark]:
    """Of the effects of a cause, those that change the drawbar pull alone, where more was measured.

    Any force along the travel direction has such a signature, by whatever law it grows.
    """
    if len(posterior.terms.readings.channels) == 1:
        return []
    channel = posterior.only_channel
    alone = [
        name
        for name in names
        if channel.get(name) == PULL and posterior.problem.effects[name].about.kind != "sensor"
    ]
    return [
        Remark(
            "like-another-force",
            f"that {name} is the force that is missing: it changes the drawbar pull alone, as the "
            "drag of a cable or of the carriage does",
            (name,),
        )
        for name in alone
    ]
