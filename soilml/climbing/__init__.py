"""Climbing ability of a rover, from gentle slopes and artificial slip."""
