"""Steady windows of a run, and the errors of their means."""
