"""Slip and soil parameters from torque, vibration and sinkage of a wheel-leg."""
