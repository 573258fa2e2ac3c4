"""Training data: features, true values of the targets, and which rows share a soil."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from datagen.recipe import parse_recipe
from soilml.arrays import Floats
from soilml.config.compatibility import recipe_content
from soilml.errors import InputError, TableError
from soilml.io.declared_settings import text_in_si
from soilml.io.read_table import read_table
from soilml.onboard.features import compute_features, inputs_of
from soilml.parameters import declared
from soilml.physics.effects import EFFECTS
from soilml.physics.soils import Soil
from soilml.quantities import QUANTITIES, column

PER_ROW = ("slip",)  # Targets that differ between the rows of a run: its rows cannot be pooled
PER_RUN = (*declared(Soil), "normal_stiffness")  # Targets with one value for all rows of a run


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


LEAST_ROWS = 12  # With fewer rows, no error that was left out is large enough for a 90 % interval


@dataclass(frozen=True)
class Dataset:
    """Rows with measured quantities, features, and true values of the targets."""

    measured: dict[str, Floats]  # (n,) readings in SI units, by name
    #: (n, d) and (n, q) inputs of the regressors, and true values
    features: Floats
    targets: Floats
    run: NDArray[np.int64]  # (n,) run number; rows of a run have one soil
    row: NDArray[np.int64]  # (n,) number of the row in the file
    feature_names: tuple[str, ...]
    target_names: tuple[str, ...]
    #: (q,) range of the prior of the targets
    lower: Floats
    upper: Floats
    recipe: str  # recipe of the data as JSON
    dropped: int  # rows of the file without equilibrium or without a reading

    def __len__(self) -> int:
        return len(self.targets)

    def rows(self, index: NDArray[np.int64] | NDArray[np.bool_]) -> Dataset:
        """The rows of an index array or a mask."""
        return replace(
            self,
            measured={name: values[index] for name, values in self.measured.items()},
            features=self.features[index],
            targets=self.targets[index],
            run=self.run[index],
            row=self.row[index],
        )

    def runs(self) -> list[NDArray[np.int64]]:
        """Row indices of each run, shuffled.

        Rows are generated from a low-discrepancy sequence: without the shuffle, the first rows of
        all runs would have similar operating conditions.
        """
        order = np.random.default_rng(0).permutation(len(self))
        order = order[np.argsort(self.run[order], kind="stable")]
        return np.split(order, np.flatnonzero(np.diff(self.run[order])) + 1)


def read_dataset(
    path: str | os.PathLike[str], features: Sequence[str], targets: Sequence[str]
) -> Dataset:
    """Read a file that `soilml generate` wrote; rows without equilibrium or a reading are dropped.

    Raises `TableError` for a missing column, and for fewer than 12 usable rows; `InputError` for a
    target that does not vary, or that has noise.
    """
    inputs = inputs_of(features)
    needed = ["run", *(column(name) for name in (*inputs, *targets))]
    table = read_table(path, filled=("run",))
    for name in needed:
        if name not in table:
            raise TableError(
                f"{path}: column {name} is missing, which the spec needs; the data have: "
                f"{', '.join(table.columns)}"
            )
    usable = table.answered.copy()
    for name in needed[1:]:
        usable &= np.isfinite(table[name])
    if usable.sum() < LEAST_ROWS:
        raise TableError(
            f"{path}: {int(usable.sum())} usable rows; needed are {LEAST_ROWS} or more to train, "
            "calibrate and score"
        )
    kept = table.rows(usable)
    measured = {name: kept[column(name)] for name in inputs}
    truth = np.stack([kept[column(name)] for name in targets], axis=1)
    if float(np.ptp(truth, axis=0).min()) <= 0.0:
        raise InputError(f"{path}: a target does not vary; give it a range in the recipe")
    recipe = table.metadata.get("soilml_recipe", "{}")
    content = _checked_recipe(recipe, str(path))
    check_measured(targets, content, str(path))
    ends = [_ends(prior_of(name, content), truth[:, i], name) for i, name in enumerate(targets)]
    return Dataset(
        measured=measured,
        features=compute_features(features, measured),
        targets=truth,
        run=np.unique(kept["run"], return_inverse=True)[1].astype(np.int64),
        row=np.flatnonzero(usable),
        feature_names=tuple(features),
        target_names=tuple(targets),
        lower=np.asarray([low for low, _ in ends]),
        upper=np.asarray([high for _, high in ends]),
        recipe=recipe,
        dropped=int(len(table) - usable.sum()),
    )


def _checked_recipe(text: str, source: str) -> dict[str, Any]:
    """The content of a recipe in JSON, {} where the data were not simulated.

    Raises `InputError` where it is not a valid recipe. Effects of a user's file, which are not
    known here, are not checked.
    """
    content = recipe_content(text, source)
    if content:
        known = [entry for entry in content.get("effect", []) if entry["name"] in EFFECTS]
        parse_recipe(json.dumps(json.loads(text) | {"effect": known}), f"recipe of {source}")
    return content


def _ends(prior: object, truth: Floats, name: str) -> tuple[float, float]:
    """The range of a target's prior in SI units, from its values where the recipe has none."""
    if isinstance(prior, dict):
        prior = prior.get("range")
    if isinstance(prior, list):
        unit = QUANTITIES[name].unit
        low, high = (text_in_si(v, unit, name) if isinstance(v, str) else float(v) for v in prior)
        return low, high
    return float(truth.min()), float(truth.max())
