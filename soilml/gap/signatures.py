"""What each effect would do to the readings: its signature."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.case import Case
from soilml.effects.base import Effect
from soilml.errors import InputError
from soilml.gap.cells import Cells
from soilml.gap.predict import predicted, size_axis
from soilml.gap.smooth import distinct
from soilml.operating import COVARIATES

Floats = NDArray[np.float64]

#: Signatures are secants at this share of the reference size: some effects begin with a root.
SECANT = 0.5


@dataclass(frozen=True)
class Signature:
    """The change of every cell, (m,), per reference size of an effect."""

    name: str
    kind: str
    column: Floats
    #: +1 or -1 where the size can only be of that sign, 0 where it may be of both
    sign: int


@dataclass(frozen=True)
class Untestable:
    """An effect of which these runs can say nothing, and why."""

    name: str
    reason: str


def grown(case: Case, effect: type[Effect]) -> Case:
    """The case with one effect more, at its neutral size."""
    made: Any = effect()
    return replace(case, model=case.model + made)


def signatures(
    case: Case, cells: Cells, effects: Mapping[str, type[Effect]]
) -> tuple[list[Signature], list[Untestable]]:
    """Signatures of all effects that the case lacks, and those that these runs cannot test."""
    own = {effect.name for effect in case.model.effects}
    base = predicted(case, [], np.zeros((1, 0)), cells)[0]
    found, cannot = [], []
    for name, effect in effects.items():
        if name in own:
            continue
        if reason := _lacking(effect, cells):
            cannot.append(Untestable(name, reason))
            continue
        axis = size_axis(effect, None)
        x = SECANT if axis.upper >= SECANT else -SECANT
        try:
            moved = predicted(grown(case, effect), [axis], np.asarray([[x]]), cells)[0]
        except InputError as error:
            cannot.append(Untestable(name, str(error)))
            continue
        column = (moved - base) / x
        if not np.isfinite(column).all():
            cannot.append(Untestable(name, "the model has no equilibrium with it in every row"))
            continue
        if not np.any(np.abs(column) > 1e-6 * cells.std):
            cannot.append(Untestable(name, "it changes no reading that there is"))
            continue
        sign = 0 if axis.lower < 0.0 < axis.upper else int(np.sign(x))
        found.append(Signature(name, effect.about.kind, column, sign))
    return found, cannot


def _lacking(effect: type[Effect], cells: Cells) -> str:
    """Why these runs cannot test an effect for want of a covariate; nothing where they can."""
    if effect.about.varied:
        return f"needs {effect.about.varied}"
    for field in effect.about.needs:
        value = getattr(cells.at, field)
        if value is None:
            return f"needs the column {COVARIATES[field]}"
        if distinct(np.asarray(value, dtype=np.float64)) < 2:
            return f"needs runs at several values of {COVARIATES[field]}"
    return ""
