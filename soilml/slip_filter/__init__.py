"""Slip, body speed and soil of a rover without odometry."""
