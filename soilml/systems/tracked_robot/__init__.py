"""A robot on two tracks: pull, evaluation of sensor signals and soil parameters.

`TrackedRobot` predicts the drawbar pull, and `evaluate_log` goes from the log of pulls to the soil;
`steady_pulls` gives its rows. Source: Wang, Yan and Du, J. Terramechanics 77, 2018.
"""

from soilml.systems.tracked_robot.robot import DiscreteGrousers, TrackedRobot, grouser_pull
from soilml.systems.tracked_robot.signals import (
    StationaryMean,
    rear_sinkage,
    slip_from_displacements,
    stationary_mean,
)
from soilml.systems.tracked_robot.track_log import TrackLog, evaluate_log, steady_pulls

__all__ = [
    "DiscreteGrousers", "StationaryMean", "TrackLog", "TrackedRobot", "evaluate_log",
    "grouser_pull", "rear_sinkage", "slip_from_displacements", "stationary_mean", "steady_pulls",
]  # fmt: skip
