"""The interface of a running gear."""

from __future__ import annotations

from typing import Any, ClassVar, Protocol, runtime_checkable

from soilml.arrays import Array, Real
from soilml.physics.contact import Contact, Resolution
from soilml.physics.operating_point import Operating
from soilml.physics.soils import Soil


@runtime_checkable
class Gear(Protocol):
    """A running gear: a frozen dataclass of its dimensions that describes its contact.

    `contact_geometry` gives the contact as a few numbers per row (angles, radii), which effects may
    change; `contact` discretises it into points. All arrays have shape (batch,) unless noted.
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

    def largest_sinkage(self) -> Real:
        """The largest sinkage for which the gear's model holds, m."""
        ...

    def initial_sinkage(self, soil: Soil, at: Operating) -> Array:
        """A first estimate of the sinkage, m, where the search begins."""
        ...

    def contact_geometry(self, sinkage: Array, soil: Soil, at: Operating) -> Any:
        """The contact at this sinkage (m), of a type of the gear's own that has `entry` (rad)."""
        ...

    def geometry_status(self, geometry: Any) -> Array:
        """`soilml.row_status.Status` where a geometry cannot carry stresses, 0 where it can."""
        ...

    def contact(
        self, geometry: Any, at: Operating, resolution: Resolution = Resolution.FULL
    ) -> Contact:
        """The points along the contact, (points, batch), for integration."""
        ...

    def profile_contact(self, geometry: Any, at: Operating, points: int) -> tuple[Array, Contact]:
        """Points for a stress profile: their angles (points, batch), and a contact without area."""
        ...
