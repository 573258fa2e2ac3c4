"""Regressors with a predictive variance, as scikit-learn estimators.

A new regressor is one file here with a subclass of `GaussianRegressor`, and one line in the
catalogue `REGRESSORS` of `training.spec`.
"""
