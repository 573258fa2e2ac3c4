"""A gear whose forces another program computed: an emulator of its runs in place of equations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar, NoReturn, final

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats, Real
from soilml.errors import InputError
from soilml.parameters import Parameter
from soilml.physics.contact import Force
from soilml.physics.operating_point import Operating
from soilml.physics.soils import Soil
from soilml.row_status import Status

#: How far beyond the design, as a share of its range, an input counts; farther, it stays there.
MARGIN = 0.05
#: How far slip and load may be beyond it: errors of their sensors reach so far, questions do not.
FARTHEST = 0.2


@final
@dataclass(frozen=True, kw_only=True)
class EmulatedGear:
    """Torque, drawbar pull and sinkage by an emulator of the runs of a simulator.

    It has no contact and no stress, so that effects act on what goes in and what comes out alone.

    radius, width: Of the wheel that was simulated, m.
    inputs: `slip`, `load`, and parameters of the soil: those that the runs differ in.
    lower, upper, logarithmic: Ends of the design, and whether an input counts by its logarithm,
        (d,) each.
    channels: `torque`, `drawbar_pull`, `sinkage`, as far as the runs have them.
    emulate: Channels (m, k) at points (m, d) of the unit cube.
    """

    name: ClassVar[str] = "simulator"
    radius: Annotated[Real, Parameter("m", 1e-3, 10.0, "radius of the simulated wheel")]
    width: Annotated[Real, Parameter("m", 1e-3, 10.0, "width of the simulated wheel")]
    inputs: tuple[str, ...]
    lower: tuple[float, ...]
    upper: tuple[float, ...]
    logarithmic: tuple[bool, ...]
    channels: tuple[str, ...]
    emulate: Callable[[Floats], Floats] = field(repr=False)

    def forces(self, soil: Soil, at: Operating) -> Force:
        """Forces (batch,); a channel that the runs lack is NaN."""
        values = {"slip": at.slip, "load": at.load}
        columns = [
            np.asarray(values.get(name, getattr(soil, name, None)), dtype=np.float64)
            for name in self.inputs
        ]
        shape = np.broadcast_shapes(*(c.shape for c in columns), np.shape(at.slip))
        u = self.fractions(np.stack([np.broadcast_to(c, shape).ravel() for c in columns], axis=1))
        found = self.emulate(np.clip(u, -MARGIN, 1.0 + MARGIN))
        nan = np.full(shape, np.nan)
        u = u[:, [self.inputs.index(name) for name in ("slip", "load")]]
        outside = ((u < -FARTHEST) | (u > 1.0 + FARTHEST)).any(axis=1).reshape(shape)
        out = {name: found[:, i].reshape(shape) for i, name in enumerate(self.channels)}
        return Force(
            load=np.broadcast_to(np.asarray(at.load, dtype=np.float64), shape),
            torque=out.get("torque", nan),
            drawbar_pull=out.get("drawbar_pull", nan),
            sinkage=out.get("sinkage", nan),
            entry_angle=nan,
            status=np.where(outside, int(Status.NOT_SIMULATED), 0),
        )

    def fractions(self, x: Floats) -> Floats:
        """Inputs (m, d) as points of the unit cube."""
        low, high, at = (
            np.where(self.logarithmic, np.log(np.maximum(v, 1e-300)), v)
            for v in (self.lower, self.upper, x)
        )
        return np.asarray((at - low) / (high - low))

    def beyond(self, name: str, values: Floats) -> NDArray[np.bool_]:
        """Whether values (m,) of an input lie farther beyond the design than `MARGIN`."""
        i = self.inputs.index(name)
        x = np.ones((len(values), len(self.inputs)))
        x[:, i] = values
        u = self.fractions(x)[:, i]
        return np.asarray((u < -MARGIN) | (u > 1.0 + MARGIN))

    def cut(self, name: str, ends: tuple[float, float]) -> tuple[float, float]:
        """A range of an input without what lies beyond the design."""
        i = self.inputs.index(name)
        return max(ends[0], self.lower[i]), min(ends[1], self.upper[i])

    def largest_sinkage(self) -> Real:
        """The radius (m): deeper wheels roll no more."""
        return self.radius

    def _refuse(self, *given: Any, **named: Any) -> NoReturn:
        """Refuse what asks for a contact, which a simulator has not."""
        raise InputError(
            "a simulator gives forces alone, and this asks for the contact of its wheel; take a "
            "model file without [simulator]"
        )

    initial_sinkage = contact_geometry = geometry_status = contact = profile_contact = _refuse
