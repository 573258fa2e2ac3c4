"""Recalibration on unseen rows, the training domain, and scores."""
