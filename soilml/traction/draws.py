"""Equally weighted draws of the soil, and of the model's error beside each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.errors import InputError
from soilml.fitting.predictions import forces_of_one_gear
from soilml.numerics.smooth_process import SmoothFunctions
from soilml.physics.contact import Force
from soilml.physics.operating_point import Operating
from soilml.physics.soils.gravity_law import CHANGED, GravityChange


@dataclass(frozen=True)
class DrawnErrors:
    """Errors of n draws, of each channel and gear that has one.

    functions: By channel and gear; the gear of a case with one is "".
    weights: Weights (n, q) of the functions.
    slip, load: Range of the errors; beyond it they are as at its end.
    """

    functions: Mapping[tuple[str, str], SmoothFunctions]
    weights: Mapping[tuple[str, str], Floats]
    slip: tuple[float, float]
    load: tuple[float, float]

    def at(
        self, channel: str, gear: str, draw: NDArray[np.int64], slip: Floats, load: Floats
    ) -> Floats:
        """Errors (k,), in the channel's unit, of these draws at slips and loads (k,), N."""
        key = channel, gear
        if key not in self.functions:
            return np.zeros(len(draw))
        functions = self.functions[key].at(np.clip(slip, *self.slip), np.clip(load, *self.load))
        return np.asarray((functions * self.weights[key][draw]).sum(axis=1))

    def of_draws(self, index: NDArray[np.int64]) -> DrawnErrors:
        """The errors of some of the draws."""
        return replace(self, weights={key: w[index] for key, w in self.weights.items()})

    def added_to(
        self, force: Force, gear: str, draw: NDArray[np.int64], slip: Floats, load: Floats
    ) -> Force:
        """Forces (k,) of these draws with their errors."""
        own = [name for name, of in self.functions if of == gear]
        errors = {name: self.at(name, gear, draw, slip, load) for name in own}
        return replace(force, **{name: getattr(force, name) + e for name, e in errors.items()})


@dataclass(frozen=True)
class SoilDraws:
    """Draws (n, p) of the parameters `names`, in SI units, and errors of the model of each."""

    names: tuple[str, ...]
    values: Floats
    errors: DrawnErrors | None = None

    def of(self, case: Case, rows: NDArray[np.int64]) -> Case:
        """The case with the values of these draws as arrays of the shape of `rows`."""
        known = case.parameters()
        kept = {n: self.values[rows, i] for i, n in enumerate(self.names) if n in known}
        return case.with_values(kept)

    def of_draws(self, index: NDArray[np.int64]) -> SoilDraws:
        """Some of the draws."""
        errors = None if self.errors is None else self.errors.of_draws(index)
        return SoilDraws(self.names, self.values[index], errors)

    def at_gravity(self, case: Case, change: GravityChange) -> SoilDraws:
        """The draws with the parameters that they have under another gravity, (n, q).

        Each draw of the soil has a draw of the law, whatever the soil: tests under one gravity do
        not tell the law. Parameters that change and were not drawn are added. Errors of the model
        stay.

        Raises `InputError` for a case whose model is another program, whose runs had one gravity,
        and as `GravityChange.parameters` does.
        """
        if change.ratio == 1.0:
            return self
        if case.simulator is not None:
            raise InputError(
                "the runs of [simulator] had one gravity: let the program run under the other one, "
                "or take a model file with [gear]"
            )
        values = {name: self.values[:, i] for i, name in enumerate(self.names)}
        values |= {k: np.asarray(case.numbers[k]) for k in CHANGED if k not in values}
        count = len(self.values)
        new = change.parameters(values, change.draws(count))
        columns = [np.broadcast_to(column, count) for column in new.values()]
        return replace(self, names=tuple(new), values=np.stack(columns, axis=1))

    def forces(self, case: Case, draw: NDArray[np.int64], at: Operating, gear: str = "") -> Force:
        """Forces (k,) of a case of one gear, by the draw of each point (k,), with its error.

        gear: Its name, where it is one of several.
        """
        force = forces_of_one_gear(self.of(case, draw), at)
        if self.errors is None:
            return force
        slip, load = (np.asarray(v, dtype=np.float64) for v in (at.slip, at.load))
        return self.errors.added_to(force, gear, draw, slip, load)

    def on_grid(
        self, case: Case, load: Floats, slip: Floats, gear: str = "", **others: Any
    ) -> Force:
        """Forces (..., n, m) of each draw at loads (..., n), N, and slips (m,).

        others: Further fields of `Operating`, alike for all.
        """
        shape = (*load.shape, len(slip))
        *_, draw, column = (grid.ravel() for grid in np.indices(shape))
        at = Operating(slip=slip[column], load=np.repeat(load.ravel(), len(slip)), **others)
        force = self.forces(case, draw, at, gear)
        return Force(**{f.name: np.reshape(getattr(force, f.name), shape) for f in fields(Force)})
