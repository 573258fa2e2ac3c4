"""The forward model: load case to equilibrium to forces."""
