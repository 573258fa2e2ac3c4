"""A robot on two tracks: pull, belt tension, evaluation of sensor signals and soil parameters.

`TrackedRobot` predicts the drawbar pull, `track_balance` the distribution of the load along a belt,
and `identify_groups` the soil parameters from groups of pulls. `low_pass`, `stationary_mean`,
`slip_from_displacements` and `rear_sinkage` turn logged signals into the columns of a table.
Source: Wang, Yan and Du, J. Terramechanics 77, 2018.
"""

from soilml.systems.tracked_robot.group_identification import GroupFits, identify_groups
from soilml.systems.tracked_robot.robot import (
    DiscreteGrousers,
    TrackBalance,
    TrackedRobot,
    grouser_pull,
    track_balance,
)
from soilml.systems.tracked_robot.signals import (
    StationaryMean,
    low_pass,
    rear_sinkage,
    slip_from_displacements,
    stationary_mean,
)

__all__ = [
    "DiscreteGrousers", "GroupFits", "StationaryMean", "TrackBalance", "TrackedRobot",
    "grouser_pull", "identify_groups", "low_pass", "rear_sinkage", "slip_from_displacements",
    "stationary_mean", "track_balance",
]  # fmt: skip
