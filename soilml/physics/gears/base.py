"""What a running gear must answer."""

from __future__ import annotations

from typing import Any, ClassVar, Protocol, runtime_checkable

from soilml.arrays import Array, Real
from soilml.physics.contact import Contact
from soilml.physics.operating_point import Operating
from soilml.physics.soils.soil import Soil


@runtime_checkable
class Gear(Protocol):
    """A running gear: a frozen dataclass of its dimensions that can describe its contact.

    `shape` gives the contact as a few numbers per row (angles, radii), which effects may change;
    `contact` cuts that shape into points. Both take arrays of shape (batch,).
    """

    name: ClassVar[str]

    @property
    def radius(self) -> Real:
        """Radius of the wheel, of a track's end wheels or of the arc of a foot, m."""
        ...

    @property
    def width(self) -> Real:
        """Width of the gear, m."""
        ...

    def deepest(self) -> Real:
        """The largest sinkage that the gear's model holds for, m."""
        ...

    def guess(self, soil: Soil, at: Operating) -> Array:
        """A first estimate of the sinkage, m."""
        ...

    def shape(self, sinkage: Array, soil: Soil, at: Operating) -> Any:
        """The contact at this sinkage, before it is cut into points."""
        ...

    def flaw(self, shape: Any) -> Array:
        """`soilml.row_status.Status`: why a shape cannot carry stresses, 0 where it can."""
        ...

    def contact(self, shape: Any, at: Operating) -> Contact:
        """The points along the contact, for integration."""
        ...

    def rough(self, shape: Any, at: Operating) -> Contact:
        """Fewer points, good for a few per cent of the load."""
        ...

    def stations(self, shape: Any, at: Operating, points: int) -> tuple[Array, Contact]:
        """Points along the contact for looking at: their angles (points, batch), and themselves."""
        ...
