"""Experiments for a gap analysis: discriminating runs and the identifiability audit."""
