"""What a model file holds: the case, its priors and the measurement noise."""
