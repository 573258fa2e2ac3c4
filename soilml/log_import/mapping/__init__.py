"""The map of a log: which column is which quantity, in which unit, and what stands between."""
