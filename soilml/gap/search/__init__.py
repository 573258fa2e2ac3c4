"""Search for missing effects: candidate fits, stepwise selection, cross-validation, verdict."""
