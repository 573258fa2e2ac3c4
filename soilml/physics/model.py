"""The model: a running gear with effects, on any soil under any operating conditions."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any, final

import numpy as np

from soilml.arrays import Array, Real, namespace
from soilml.errors import InputError
from soilml.parameters import check, mapped, values
from soilml.physics.computing_device import DEVICE_CHUNK, current_device, from_device, to_device
from soilml.physics.contact import Force
from soilml.physics.effects.base import Effect, apply_stage
from soilml.physics.equilibrium import equilibrium_forces, sensor_readings
from soilml.physics.forces import stress_profile
from soilml.physics.gears import GEARS
from soilml.physics.gears.base import Gear
from soilml.physics.load_case import LoadCase, rows
from soilml.physics.operating_point import Operating
from soilml.physics.sinkage_estimate import SinkageEstimate
from soilml.physics.soils import Soil

#: Rows solved together: many enough that calls cost little beside the arithmetic, and few enough
#: that the points along their contacts stay in a processor's cache.
CHUNK = 2048

# The C library gives memory back after every call and fetches it again, which takes longer than the
# arithmetic, until it has once freed a block this large.
np.empty(24 << 20, np.uint8)


@final
@dataclass(frozen=True)
class Model:
    """A running gear with a list of effects; `model + effect` has one more.

    Examples
    --------
    >>> import numpy as np
    >>> from soilml import Model, Operating, SlipSinkage, Wheel, soil
    >>> model = Model(Wheel(radius=0.15, width=0.12))
    >>> sand, at = soil("wong1989/dry_sand"), Operating(slip=np.array([0.1, 0.3, 0.6]), load=60.0)
    >>> force = model(sand, at)
    >>> force.torque.round(2).tolist()  # N m
    [1.19, 2.26, 3.31]
    >>> digging = model + SlipSinkage(n1=0.4)
    >>> digging(sand, at).sinkage.round(4).tolist()  # m
    [0.018, 0.0225, 0.0306]
    """

    gear: Gear
    effects: tuple[Effect, ...] = ()

    def __post_init__(self) -> None:
        for effect in self.effects:
            if not isinstance(effect, Effect):
                raise InputError(
                    f"{type(effect).__name__} is not an effect; derive it from "
                    "soilml.physics.effects.Effect"
                )
            if not effect.applies_to(self.gear):
                meant = [
                    gear.name for gear in GEARS.values() if issubclass(gear, effect.gear_types)
                ]
                to = f"it applies to: {', '.join(meant)}" if meant else "it acts at the contact"
                raise InputError(
                    f"the effect {effect.name} does not apply to the gear {self.gear.name!r}; {to}"
                )

    def __add__(self, effect: Effect) -> Model:
        if any(effect.name == other.name for other in self.effects):
            raise InputError(f"the model has the effect {effect.name!r} already")
        return replace(self, effects=(*self.effects, effect))

    def __call__(self, soil: Soil, at: Operating) -> Force:
        """Forces at equilibrium, as the sensors report them.

        Parameters
        ----------
        soil, at
            Their numbers and those of the model may be arrays, which broadcast.

        Returns
        -------
        Force
            Arrays of the common shape. A row without equilibrium is NaN, with the reason in
            `status`.

        Raises
        ------
        InputError
            For a value outside its bounds, or a missing field that an effect needs.
        """
        load_case, shape = self.load_case(soil, at)
        xp, device = namespace(load_case.at.slip), current_device()
        with np.errstate(all="ignore"):  # rows without an answer are flagged, not warned about
            if device is not None and xp is np:
                force = from_device(in_chunks(to_device(load_case, device), sensor_readings))
            else:
                force = in_chunks(load_case, sensor_readings)
        return Force(**{f.name: xp.reshape(getattr(force, f.name), shape) for f in fields(Force)})

    def profile(self, soil: Soil, at: Operating, points: int = 101) -> Profile:
        """Stresses along the contact at equilibrium, from entry to exit.

        Returns
        -------
        Profile
            Arrays (points, ...); NaN in rows without equilibrium.

        Raises
        ------
        InputError
            As a call of the model does.
        """
        load_case, shape = self.load_case(soil, at)
        xp = namespace(load_case.at.slip)
        with np.errstate(all="ignore"):
            sinkage = in_chunks(
                load_case, equilibrium_forces
            ).sinkage  # the true one, without sensor errors
            angle, stresses = stress_profile(load_case, sinkage, points)
        parts = (angle, stresses.normal, stresses.shear)
        return Profile(*(xp.reshape(part, (part.shape[0], *shape)) for part in parts))

    def load_case(self, soil: Soil, at: Operating) -> tuple[LoadCase, tuple[int, ...]]:
        """All rows as arrays (batch,), or () where shared, once checked; and their shape.

        Raises `InputError` as a call of the model does.
        """
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


def flattened(load_case: LoadCase) -> tuple[LoadCase, tuple[int, ...]]:
    """The load case as float64 arrays: (batch,), or () where shared by all rows; and the shape."""
    parameters = values(load_case)
    xp = namespace(*parameters.values())
    device = next((v.device for v in parameters.values() if hasattr(v, "device")), None)
    arrays = {k: _float64(v, xp, device) for k, v in parameters.items()}
    try:
        shape: tuple[int, ...] = np.broadcast_shapes(*(tuple(v.shape) for v in arrays.values()))
    except ValueError:
        sizes = ", ".join(f"{k} {tuple(v.shape)}" for k, v in arrays.items() if v.ndim)
        raise InputError(f"arrays that do not fit together: {sizes}") from None
    size = math.prod(shape)
    for path, array in arrays.items():
        if array.shape == shape == (size,):
            continue
        if array.ndim > 0 or path.startswith("at."):
            arrays[path] = xp.reshape(xp.broadcast_to(array, shape), (size,))
    in_order = iter(arrays.values())
    return mapped(load_case, lambda _: next(in_order)), shape


def _float64(value: Real, xp: Any, device: Any) -> Array:
    """The value as a float64 array; one that is such already keeps its gradient."""
    if getattr(value, "dtype", None) == xp.float64:
        return value
    return xp.asarray(value, dtype=xp.float64, device=device)


def in_chunks(load_case: LoadCase, solve: Callable[..., Force], *columns: Array) -> Force:
    """The forces of all rows, solved in chunks of driving and of braking rows.

    Driving and braking (by the true slip) are kept apart, because their contacts are discretised
    differently. `solve` takes the load case of some rows and those rows of each of the `columns`,
    arrays (batch,).
    """
    xp = namespace(load_case.at.slip)
    at = apply_stage(load_case.effects, "on_operating", load_case.at, load_case)
    braking: Array = at.slip < 0
    size = braking.shape[0]
    on_processor = str(getattr(braking, "device", "cpu")).startswith("cpu")
    chunk = CHUNK if on_processor else DEVICE_CHUNK
    parts, order = [], []
    for group in (xp.nonzero(~braking)[0], xp.nonzero(braking)[0]):
        for start in range(0, group.shape[0], chunk):
            index = group[start : min(start + chunk, group.shape[0])]
            if index.shape[0] == size:
                parts.append(solve(load_case, *columns))
            else:
                parts.append(solve(rows(load_case, index), *(c[index] for c in columns)))
            order.append(index)
    if not parts:
        nothing: dict[str, Array] = {
            f.name: xp.zeros_like(load_case.at.slip) for f in fields(Force)
        }
        return Force(**nothing | {"status": xp.astype(nothing["status"], xp.int64)})
    if len(parts) == 1:
        return parts[0]
    back = xp.argsort(xp.concat(order, axis=0))
    joined: dict[str, Any] = {
        f.name: xp.take(xp.concat([getattr(p, f.name) for p in parts], axis=0), back, axis=0)
        for f in fields(Force)
    }
    return Force(**joined)


def in_chunks_near(
    load_case: LoadCase, solve: Callable[..., Force], estimate: SinkageEstimate | None
) -> Force:
    """The same, solved from an estimate of the sinkage of all rows, if there is one."""
    if estimate is None:
        return in_chunks(load_case, solve)

    def solve_near(part: LoadCase, log_sinkage: Array, slope: Array) -> Force:
        return solve(part, replace(estimate, log_sinkage=log_sinkage, slope=slope))

    return in_chunks(load_case, solve_near, estimate.log_sinkage, estimate.slope)
