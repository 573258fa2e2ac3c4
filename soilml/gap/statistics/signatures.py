"""What each effect would do to the readings: its signature."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.errors import InputError
from soilml.gap.data.observations import Cells, distinct
from soilml.gap.statistics.coordinates import predicted, size_axis
from soilml.physics.effects.base import Effect
from soilml.physics.operating_point import COVARIATES

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
    """The case with the effect: as it has it, or with one more at its neutral size."""
    if any(own.name == effect.name for own in case.model.effects):
        return case
    made: Any = effect()
    return replace(case, model=case.model + made)


def standing(case: Case, path: str, unit: float) -> float:
    """The coordinate at which a case has an effect's size, in reference sizes; 0 where not."""
    own = case.parameters()
    return float(own[path][1]) / unit if path in own else 0.0


def signatures(
    case: Case, cells: Cells, effects: Mapping[str, type[Effect]]
) -> tuple[list[Signature], list[Untestable]]:
    """Signatures of all effects, and those that these runs cannot test.

    An effect that the case has is moved from the size that it has there: it may be wrong.
    """
    base = predicted(case, [], np.zeros((1, 0)), cells)[0]
    found, cannot = [], []
    for name, effect in effects.items():
        if reason := _lacking(effect, cells):
            cannot.append(Untestable(name, reason))
            continue
        axis = size_axis(effect, None)
        at = standing(case, axis.path, axis.prior.upper)
        x = SECANT if axis.upper >= at + SECANT else -SECANT
        try:
            moved = predicted(grown(case, effect), [axis], np.asarray([[at + x]]), cells)[0]
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
        sign = 0 if axis.lower < at < axis.upper else int(np.sign(x))
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
