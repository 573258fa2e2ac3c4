"""Regressors with a predictive variance, in the manner of scikit-learn."""
