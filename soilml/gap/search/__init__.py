"""Search for missing effects: candidate fits, stepwise selection and posterior probabilities."""
