"""A soil that is followed along a drive: readings as they come, checked one by one."""

from soilml.onboard.tracking.soil_tracker import Event, SoilTracker, TrackerState
from soilml.onboard.tracking.state_file import read_state, write_state

__all__ = ["Event", "SoilTracker", "TrackerState", "read_state", "write_state"]
