"""Sub-commands of `soilml` that come with the ground software."""
