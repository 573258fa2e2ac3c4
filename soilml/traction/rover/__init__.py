"""A whole rover on a slope: slip, torque, sinkage and energy of its wheels, with bands."""

from soilml.traction.rover.performance import RoverPerformance, rover_performance

__all__ = ["RoverPerformance", "rover_performance"]
