"""The sub-commands of `soilml` that need no ground software to be listed."""
