"""Operating conditions of a running gear."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, final

from soilml.arrays import Array, Real, namespace
from soilml.parameters import Parameter

#: Slip of 1 is a wheel that spins on the spot, -1 a locked wheel that slides: neither rolls.
MOST_SLIP = 1.0 - 1e-9


@final
@dataclass(frozen=True, kw_only=True)
class Operating:
    """Slip ratio and vertical load; numbers or arrays of any shapes that broadcast.

    Slip is 1 - v/(r omega) when driving (0 to 1) and r omega/v - 1 when braking (-1 to 0). The
    other fields are None where they were not measured; an effect that needs one then raises
    `InputError`.

    Examples
    --------
    >>> import numpy as np
    >>> from soilml import Operating
    >>> speed, rim_speed = 0.07, 0.1  # m/s
    >>> at = Operating(slip=1.0 - speed / rim_speed, load=np.array([40.0, 60.0]), speed=speed)
    >>> round(at.slip, 3), at.pass_number is None
    (0.3, True)
    """

    slip: Annotated[Real, Parameter("1", -MOST_SLIP, MOST_SLIP, "slip ratio")]
    load: Annotated[Real, Parameter("N", 1e-6, 1e7, "vertical load")]
    speed: Annotated[
        Real | None, Parameter("m/s", -100.0, 100.0, "travel speed, below zero in reverse")
    ] = None
    pass_number: Annotated[
        Real | None, Parameter("1", 1.0, 1e4, "1 on virgin soil, 2 in a rut")
    ] = None
    slip_angle: Annotated[
        Real | None, Parameter("rad", -1.6, 1.6, "between wheel plane and travel")
    ] = None
    progress: Annotated[
        Real | None, Parameter("1", 0.0, 1.0, "share of the campaign that is over")
    ] = None
    load_direction: Annotated[
        Real | None, Parameter("1", -1.0, 1.0, "1 where the load last rose, -1 where it fell")
    ] = None
    #: names of the gears that were driven, (n,); a model, which is of one gear, does not read it
    gear: Any = None


#: Fields that follow from the order of the rows, and the column of each. A run is not set to them:
#: rows that differ in nothing else are repeats.
FROM_ORDER = {"progress": "progress", "load_direction": "load_direction"}
#: Their values after a campaign, where no order is known.
AFTER_CAMPAIGN = {"progress": 1.0, "load_direction": 0.0}
#: Optional fields of `Operating`, and the column of each.
COVARIATES = {
    "speed": "speed_m_s",
    "pass_number": "pass",
    "slip_angle": "slip_angle_rad",
    **FROM_ORDER,
}


def campaign_share(at: Operating) -> Array:
    """Share of the campaign that is over at each row, (batch,); 1 where it is not known."""
    if at.progress is None:
        return namespace(at.slip).ones_like(at.slip)
    return at.progress
