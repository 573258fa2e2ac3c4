"""A tracked robot: its tests, and the soil from its drawbar pull."""
