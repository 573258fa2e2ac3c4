"""A wheel-leg walking over time, by resistive-force theory."""
