"""Sub-command of `soilml` that datagen provides: `generate`."""
