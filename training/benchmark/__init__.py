"""Methods compared on sets of readings whose soil is known: `compare` (in `comparison`).

The sets are test data of the user, or those of the packaged recipe `benchmark`. The exact posterior
of the same sets is one of the methods; it is the Bayes limit, which no estimator beats on average.
"""
