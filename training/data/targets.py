"""What a spec may have learned: parameters of the soil, its stiffness, and slip."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from soilml.errors import InputError
from soilml.onboard.features import inputs_of
from soilml.parameters import declared
from soilml.physics.soils import Soil

#: Targets that differ from row to row of a run: its rows cannot be joined.
PER_ROW = ("slip",)
#: Targets of which one value holds for all rows of a run.
PER_RUN = (*declared(Soil), "normal_stiffness")


def check_targets(targets: Sequence[str], features: Sequence[str]) -> None:
    """Raise `InputError` for a target that cannot be learned, or that stands among the features."""
    for name in targets:
        if name not in (*PER_ROW, *PER_RUN):
            raise InputError(
                f"targets: {name!r} is no soil parameter, nor slip: {', '.join(PER_RUN)}, "
                f"{', '.join(PER_ROW)}"
            )
        if name in inputs_of(features):
            raise InputError(f"targets: {name!r} is read by the features; it can only be one")


def check_measured(targets: Sequence[str], recipe: Mapping[str, Any], where: str) -> None:
    """Raise `InputError` where the column of a target holds readings, and not what was true."""
    for name in targets:
        for table in ("noise", "bias"):
            if name in PER_ROW and name in recipe.get(table, {}):
                raise InputError(
                    f"{where}: {name} is to be learned, but its column has {table}: generate the "
                    f"data with a recipe that has no {name} in [{table}]"
                )


def prior_of(name: str, recipe: Mapping[str, Any]) -> object:
    """The range that the recipe gives a target, as written there; None where it gives none."""
    table = recipe.get("operating", {}) if name in PER_ROW else recipe.get("soil", {}).get("prior")
    return (table or {}).get(name)
