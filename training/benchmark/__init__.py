"""Benchmark of estimators on fixed simulated sets, relative to the Bayes limit of the same sets.

`benchmark` (in `suite`) scores model files, analytic methods and functions of the caller; `goals`
(in `acceptance`) tests the scores against acceptance goals; `compare` (in `user_comparison`) does
the same on the user's test data, without a Bayes limit.
"""
