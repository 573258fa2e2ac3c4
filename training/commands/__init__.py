"""Sub-commands of `soilml` that the training package provides: `train` and `compare`."""
