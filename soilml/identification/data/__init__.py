"""Measured rows as estimators take them: operating points, readings, levels of slip and load."""
