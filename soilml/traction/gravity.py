"""Draws of a soil under another gravity."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from soilml.config.case import Case
from soilml.errors import InputError
from soilml.physics.soils.gravity_law import CHANGED, GravityChange
from soilml.traction.draws import SoilDraws


def draws_at_gravity(case: Case, draws: SoilDraws, change: GravityChange) -> SoilDraws:
    """The draws (n, p) with the parameters that they have under another gravity, (n, q).

    Each draw of the soil has a draw of the law, whatever the soil: tests under one gravity do not
    tell the law. Parameters that change and were not drawn are added. Errors of the model stay.

    Raises `InputError` for a case whose model is another program, whose runs had one gravity, and
    as `GravityChange.parameters` does.
    """
    if change.ratio == 1.0:
        return draws
    if case.simulator is not None:
        raise InputError(
            "the runs of [simulator] had one gravity: let the program run under the other one, or "
            "take a model file with [gear]"
        )
    values = {name: draws.values[:, i] for i, name in enumerate(draws.names)}
    values |= {k: np.asarray(case.numbers[k]) for k in CHANGED if k not in values}
    count = len(draws.values)
    new = change.parameters(values, change.draws(count))
    columns = [np.broadcast_to(column, count) for column in new.values()]
    return replace(draws, names=tuple(new), values=np.stack(columns, axis=1))
