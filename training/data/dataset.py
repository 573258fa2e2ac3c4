"""Rows to learn from: features, true parameters, and which rows share a soil."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from soilml.errors import InputError, TableError
from soilml.io.read_table import read_table
from soilml.onboard.features import computed, inputs_of
from soilml.quantities import QUANTITIES, column
from training.data.targets import check_measured, prior_of

Floats = NDArray[np.float64]

#: With fewer rows no interval that is measured on a fifth of them can be believed.
LEAST_ROWS = 200


@dataclass(frozen=True)
class Dataset:
    """Measured quantities by name (n,), features (n, d), targets (n, q), run numbers (n,)."""

    measured: dict[str, Floats]
    features: Floats
    targets: Floats
    run: NDArray[np.int64]
    feature_names: tuple[str, ...]
    target_names: tuple[str, ...]
    lower: Floats  # (q,) ends of the prior
    upper: Floats
    recipe: str
    dropped: int

    def __len__(self) -> int:
        return len(self.targets)

    def rows(self, index: NDArray[np.int64] | NDArray[np.bool_]) -> Dataset:
        """The rows of an index or a mask."""
        return replace(
            self,
            measured={name: values[index] for name, values in self.measured.items()},
            features=self.features[index],
            targets=self.targets[index],
            run=self.run[index],
        )

    def thinned(self, most: int = 2) -> Dataset:
        """At most so many rows of each run: rows of one soil err alike and would count double."""
        return self.rows(np.sort(np.concatenate([run[:most] for run in self.runs()])))

    def runs(self) -> list[NDArray[np.int64]]:
        """Row numbers of each run, shuffled.

        Rows of a recipe are drawn to fill the range: the first rows of all runs are driven alike.
        """
        order = np.random.default_rng(0).permutation(len(self))
        order = order[np.argsort(self.run[order], kind="stable")]
        return np.split(order, np.flatnonzero(np.diff(self.run[order])) + 1)

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of each target."""
        return tuple(QUANTITIES[name].unit for name in self.target_names)

    @property
    def run_length(self) -> NDArray[np.int64]:
        """Rows of the run that each row belongs to, (n,)."""
        _, code, count = np.unique(self.run, return_inverse=True, return_counts=True)
        return np.asarray(count[code])


def read_dataset(
    path: str | os.PathLike[str], features: Sequence[str], targets: Sequence[str]
) -> Dataset:
    """A file that `soilml generate` wrote; rows without equilibrium or a reading are dropped.

    Raises `InputError` where a target is missing, or too few rows are left to learn from.
    """
    inputs = inputs_of(features)
    needed = ["run", *(column(name) for name in (*inputs, *targets))]
    table = read_table(path, filled=("run",))
    for name in needed:
        if name not in table:
            raise TableError(
                f"{path}: column {name} is missing; the spec's features and targets must be in the "
                f"data, which hold: {', '.join(table.columns)}"
            )
    good = table.answered.copy()
    for name in needed[1:]:
        good &= np.isfinite(table[name])
    if good.sum() < LEAST_ROWS:
        raise TableError(
            f"{path}: {int(good.sum())} usable rows; needed are {LEAST_ROWS} or more to train, "
            "calibrate and score"
        )
    kept = table.rows(good)
    measured = {name: kept[column(name)] for name in inputs}
    truth = np.stack([kept[column(name)] for name in targets], axis=1)
    if float(np.ptp(truth, axis=0).min()) <= 0.0:
        raise InputError(f"{path}: a target does not vary; it cannot be learned")
    recipe = table.metadata.get("soilml_recipe", "{}")
    content = json.loads(recipe)
    check_measured(targets, content, str(path))
    ends = [_ends(prior_of(name, content), truth[:, i]) for i, name in enumerate(targets)]
    return Dataset(
        measured=measured,
        features=computed(features, measured),
        targets=truth,
        run=np.unique(kept["run"], return_inverse=True)[1].astype(np.int64),
        feature_names=tuple(features),
        target_names=tuple(targets),
        lower=np.asarray([low for low, _ in ends]),
        upper=np.asarray([high for _, high in ends]),
        recipe=recipe,
        dropped=int(len(table) - good.sum()),
    )


def _ends(prior: object, truth: Floats) -> tuple[float, float]:
    if isinstance(prior, dict):
        prior = prior.get("range")
    if isinstance(prior, list):
        return float(prior[0]), float(prior[1])
    return float(truth.min()), float(truth.max())


@dataclass(frozen=True)
class Split:
    """Rows to learn from, to stop and choose by, and to measure uncertainty on; no soil in two."""

    train: Dataset
    choose: Dataset
    calibrate: Dataset


def split(data: Dataset, seed: int, choose: float = 0.1, calibrate: float = 0.2) -> Split:
    """Split by run. Runs of many rows, where they are few, all go to the calibration part.

    There they show how surely rows of one soil may be joined; the rows that stand alone teach more
    by showing more soils.
    """
    alone = data.run_length == 1
    shared_to_calibrate = bool(0.5 <= alone.mean() < 1.0)
    codes, first = np.unique(data.run, return_index=True)
    shuffled = np.random.default_rng(seed).permutation(len(codes))
    rank = np.empty(len(codes))
    rank[shuffled] = (np.arange(len(codes)) + 0.5) / len(codes)
    if shared_to_calibrate:
        many = ~alone[first]
        rank[many] = 1.0
        singles = np.flatnonzero(~many)
        order = np.argsort(rank[singles])
        rank[singles[order]] = (np.arange(singles.size) + 0.5) / singles.size
        calibrate = 0.1
    place = rank[np.searchsorted(codes, data.run)]
    return Split(
        train=data.rows(place < 1.0 - choose - calibrate),
        choose=data.rows((place >= 1.0 - choose - calibrate) & (place < 1.0 - calibrate)),
        calibrate=data.rows(place >= 1.0 - calibrate),
    )
