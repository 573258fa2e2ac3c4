"""Readings as vectors, and the checks that they must pass before an analysis."""
