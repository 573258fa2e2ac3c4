"""Robots and instruments of the source papers, built on the forward model."""
