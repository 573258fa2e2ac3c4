"""A soil that is followed along a drive: readings as they come, checked one by one."""

from soilml.onboard.tracking.soil_tracker import Event, SoilTracker, TrackerState

__all__ = ["Event", "SoilTracker", "TrackerState"]
