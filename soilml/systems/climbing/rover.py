"""A rover on four wheels, straight up a slope."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, final

import numpy as np

from soilml.arrays import Real
from soilml.errors import InputError
from soilml.parameters import Parameter

#: The wheels of one side; both sides carry and pull equally.
WHEELS = ("front", "rear")


@final
@dataclass(frozen=True, kw_only=True)
class Rover:
    """Two front and two rear wheels of equal size; the centre of mass may be unknown.

    If `front_share` and `height_ratio` are known, so is the load of each wheel, and each wheel has
    a magnification of its own. Otherwise both wheels of a run share one.

    Parameters
    ----------
    mass
        Mass of the rover, kg.
    radius, width
        Of a wheel, m.
    gravity
        m/s^2.
    front_share
        Fraction of the weight on the front wheels on level ground.
    height_ratio
        Height of the centre of mass over the wheelbase.
    """

    mass: Annotated[float, Parameter("kg", 0.01, 1e5, "mass of the whole rover")]
    radius: Annotated[float, Parameter("m", 0.005, 5.0, "wheel radius")]
    width: Annotated[float, Parameter("m", 0.002, 5.0, "wheel width")]
    gravity: Annotated[float, Parameter("m/s^2", 0.01, 30.0, "gravity")] = 9.80665
    front_share: Annotated[
        float | None, Parameter("1", 0.05, 0.95, "share of the weight on the front wheels, flat")
    ] = None
    height_ratio: Annotated[
        float | None, Parameter("1", 0.0, 2.0, "height of the centre of mass over the wheelbase")
    ] = None

    def __post_init__(self) -> None:
        if (self.front_share is None) != (self.height_ratio is None):
            raise InputError(
                "front_share and height_ratio belong together: give both, or neither where the "
                "centre of mass is not known"
            )

    @property
    def weight(self) -> float:
        """Weight, N."""
        return self.mass * self.gravity

    @property
    def has_known_loads(self) -> bool:
        """Whether the load of each wheel follows from the slope alone."""
        return self.front_share is not None

    def loads(self, slope: Real) -> tuple[Real, Real]:
        r"""Load perpendicular to the slope on one front and one rear wheel, N.

        .. math::
            F_{zf} = \tfrac12 m g (a \cos\alpha - h \sin\alpha), \quad
            F_{zr} = \tfrac12 m g ((1 - a) \cos\alpha + h \sin\alpha)

        with a the front share on level ground and h the height of the centre of mass over the
        wheelbase: balance of moments about the wheel contacts at constant speed. The offset of
        the wheel forces from the axle is neglected.
        """
        if self.front_share is None or self.height_ratio is None:
            raise InputError("the loads of the wheels need front_share and height_ratio")
        half = 0.5 * self.weight
        across, along = np.cos(slope), np.sin(slope)
        front = half * (self.front_share * across - self.height_ratio * along)
        rear = half * ((1.0 - self.front_share) * across + self.height_ratio * along)
        return front, rear
