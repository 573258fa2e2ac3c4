"""Model files: the case, its priors and the measurement noise."""
