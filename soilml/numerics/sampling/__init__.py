"""Weighted samples of densities over the unit cube."""
