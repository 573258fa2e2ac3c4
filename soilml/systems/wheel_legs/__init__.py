"""Wheel-legs: their walk over time, their slip, and the soil from both."""
