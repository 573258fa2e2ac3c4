"""Recalibration and errors on held-out rows, the training domain, and metrics."""
