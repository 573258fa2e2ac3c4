"""Training data, their split by run, and the quantities that can be targets."""
