"""Columns of a log: their words, how they behave, and which is taken for which role."""
