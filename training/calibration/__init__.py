"""Recalibration and pooling calibration on held-out rows, the training domain, and metrics."""
