"""A wheel that measures the normal stress on its rim, and what follows from that."""

from soilml.measured_stress.balance import WheelForces, forces
from soilml.measured_stress.profile import StressProfile

__all__ = ["StressProfile", "WheelForces", "forces"]
