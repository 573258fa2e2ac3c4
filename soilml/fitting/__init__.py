"""What every fit shares: readings, coordinates, predictions, covariance and least squares."""
