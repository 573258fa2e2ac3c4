"""Statistics of a gap analysis: covariance, discrepancy and evidence, score tests, signatures."""
