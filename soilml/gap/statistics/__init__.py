"""Statistics of a gap analysis: generalised least squares, covariance, score tests, signatures."""
