"""Estimates with given numbers, for tests of what is made of estimates."""

import numpy as np

from soilml.onboard.estimate import Estimate


def made_estimate(
    mean, std, prior, in_range=True, names=("slip",), units=("1",), factor=1.645, errors=None
):
    """Gaussian estimates (..., q) whose quantities are independent; `in_range` (...)."""
    mean, std = np.broadcast_arrays(np.asarray(mean, float), np.asarray(std, float))
    return Estimate.gaussian(
        names,
        units,
        prior,
        mean,
        std[..., None] ** 2 * np.eye(len(names)),
        std,
        np.broadcast_to(np.asarray(in_range), mean.shape[:-1]),
        np.full(len(names), factor),
        errors,
    )
