"""Quantities that can be targets: soil parameters, stiffness, and slip."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from soilml.errors import InputError
from soilml.onboard.features import inputs_of
from soilml.parameters import declared
from soilml.physics.soils import Soil

#: Targets that differ between the rows of a run: its rows cannot be pooled.
PER_ROW = ("slip",)
#: Targets with one value for all rows of a run.
PER_RUN = (*declared(Soil), "normal_stiffness")


def check_targets(targets: Sequence[str], features: Sequence[str]) -> None:
    """Raise `InputError` for an unknown target, and for one that the features read."""
    for name in targets:
        if name not in (*PER_ROW, *PER_RUN):
            raise InputError(
                f"targets: {name!r} cannot be estimated; there are: {', '.join(PER_RUN)}, "
                f"{', '.join(PER_ROW)}"
            )
        if name in inputs_of(features):
            raise InputError(
                f"targets: {name!r} is also read by the features; it can be only one of them"
            )


def check_measured(targets: Sequence[str], recipe: Mapping[str, Any], where: str) -> None:
    """Raise `InputError` where the column of a target has noise: it must hold true values."""
    for name in targets:
        for table in ("noise", "bias"):
            if name in PER_ROW and name in recipe.get(table, {}):
                raise InputError(
                    f"{where}: {name} is a target, but its column has {table}: generate the "
                    f"data with a recipe that has no {name} in [{table}]"
                )


def prior_of(name: str, recipe: Mapping[str, Any]) -> object:
    """The recipe's range of a target, as written there; None where it has none."""
    table = recipe.get("operating", {}) if name in PER_ROW else recipe.get("soil", {}).get("prior")
    return (table or {}).get(name)
