"""Sub-commands of `soilml` that come with training."""
