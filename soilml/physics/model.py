"""The model: a running gear and its effects, on any soil, driven in any way."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any, final

import numpy as np

from soilml.arrays import Array, Real, namespace
from soilml.errors import InputError
from soilml.parameters import check, values, with_values
from soilml.physics.contact import Force
from soilml.physics.effects.base import Effect, suits, through
from soilml.physics.equilibrium import at_rest, settled, stresses_along
from soilml.physics.gears.base import Gear
from soilml.physics.load_case import LoadCase, rows
from soilml.physics.operating_point import Operating
from soilml.physics.soils.soil import Soil

#: Rows solved together: as many as keep the points along their contacts in a processor's cache.
CHUNK = 1024


@final
@dataclass(frozen=True)
class Model:
    """A running gear with a list of effects; `model + effect` has one more.

    model = Model(Wheel(radius=0.1, width=0.06)) + SlipSinkage(n1=0.4)
    force = model(soil("wong1989/dry_sand"), Operating(slip=slips, load=60.0))
    """

    gear: Gear
    effects: tuple[Effect, ...] = ()

    def __add__(self, effect: Effect) -> Model:
        if any(effect.name == other.name for other in self.effects):
            raise InputError(f"the model has the effect {effect.name!r} already")
        if not suits(effect, self.gear):
            kind = "tracks" if effect.about.track else "rigid wheels"
            raise InputError(f"the effect {effect.name} is one of {kind}, not of {self.gear.name}")
        return replace(self, effects=(*self.effects, effect))

    def __call__(self, soil: Soil, at: Operating) -> Force:
        """Forces at equilibrium; every number in `soil`, `at` and the model may be an array.

        They broadcast against each other, and the answer has their common shape. Raises
        `InputError` for a value outside its bounds; a row without equilibrium is NaN with its
        reason in `status`.
        """
        scene, shape = self._scene(soil, at)
        xp = namespace(scene.at.slip)
        with np.errstate(all="ignore"):  # rows without an answer are flagged, not warned about
            force = _in_chunks(scene, settled)
        return Force(**{f.name: xp.reshape(getattr(force, f.name), shape) for f in fields(Force)})

    def profile(self, soil: Soil, at: Operating, points: int = 101) -> Profile:
        """Stresses along the contact at equilibrium, from entry to exit; arrays (points, ...).

        NaN in rows without equilibrium. Raises `InputError` as a call does.
        """
        scene, shape = self._scene(soil, at)
        xp = namespace(scene.at.slip)
        with np.errstate(all="ignore"):
            sinkage = _in_chunks(scene, at_rest).sinkage  # not what a sensor makes of it
            angle, stresses = stresses_along(scene, sinkage, points)
        parts = (angle, stresses.normal, stresses.shear)
        return Profile(*(xp.reshape(part, (part.shape[0], *shape)) for part in parts))

    def _scene(self, soil: Soil, at: Operating) -> tuple[LoadCase, tuple[int, ...]]:
        check(at)
        check(soil, "soil ")
        check(self)
        return flattened(LoadCase(self.gear, soil, at, self.effects))


@dataclass(frozen=True)
class Profile:
    """Normal and shear stress (Pa) against the angle from straight down (rad), (points, ...)."""

    angle: Array
    normal: Array
    shear: Array


def flattened(scene: LoadCase) -> tuple[LoadCase, tuple[int, ...]]:
    """The scene with all arrays of shape (batch,), those shared by all rows (), and the shape."""
    given = values(scene)
    xp = namespace(*given.values())
    device = next((v.device for v in given.values() if hasattr(v, "device")), None)
    arrays = {k: _float64(v, xp, device) for k, v in given.items()}
    shape: tuple[int, ...] = np.broadcast_shapes(*(tuple(v.shape) for v in arrays.values()))
    size = math.prod(shape)
    for path, array in arrays.items():
        if array.ndim > 0 or path.startswith("at."):
            arrays[path] = xp.reshape(xp.broadcast_to(array, shape), (size,))
    return with_values(scene, arrays), shape


def _float64(value: Real, xp: Any, device: Any) -> Array:
    """The value as a float64 array; one that is such already keeps its gradient."""
    if getattr(value, "dtype", None) == xp.float64:
        return value
    return xp.asarray(value, dtype=xp.float64, device=device)


def _in_chunks(scene: LoadCase, solve: Callable[[LoadCase], Force]) -> Force:
    """Rows that truly drive and rows that brake apart: they are cut into different points."""
    xp = namespace(scene.at.slip)
    braking = through(scene.effects, "on_operating", scene.at, scene).slip < 0
    size = braking.shape[0]
    parts, order = [], []
    for group in (xp.nonzero(~braking)[0], xp.nonzero(braking)[0]):
        for start in range(0, group.shape[0], CHUNK):
            index = group[start : min(start + CHUNK, group.shape[0])]
            whole = index.shape[0] == size
            parts.append(solve(scene if whole else rows(scene, index)))
            order.append(index)
    if not parts:
        nothing: dict[str, Array] = {f.name: xp.zeros_like(scene.at.slip) for f in fields(Force)}
        return Force(**nothing | {"status": xp.astype(nothing["status"], xp.int64)})
    if len(parts) == 1:
        return parts[0]
    back = xp.argsort(xp.concat(order, axis=0))
    joined: dict[str, Any] = {
        f.name: xp.take(xp.concat([getattr(p, f.name) for p in parts], axis=0), back, axis=0)
        for f in fields(Force)
    }
    return Force(**joined)
