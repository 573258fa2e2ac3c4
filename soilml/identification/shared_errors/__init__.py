"""Errors that all rows of a set share: their sizes, and how they change the readings."""
