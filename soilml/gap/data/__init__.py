"""Stacked readings, the data checks before an analysis, and held-out rows."""
