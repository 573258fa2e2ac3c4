"""Slip and soil from the torque, vibration and sinkage of a wheel-leg."""
