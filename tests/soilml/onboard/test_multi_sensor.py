"""Estimates of one quantity from several files that cannot be fused."""

from dataclasses import replace

import numpy as np
import pytest
from made_estimates import made_estimate

from soilml.errors import InputError
from soilml.onboard.gaussian_product import PriorSummary
from soilml.onboard.multi_sensor import fuse_estimates

PRIOR = PriorSummary(np.asarray([0.3]), np.asarray([0.15]), np.asarray([-0.3]), np.asarray([0.9]))


def estimate(mean, std, prior=PRIOR, **known):
    mean, std = (np.asarray(x, float)[..., None] for x in np.broadcast_arrays(mean, std))
    return made_estimate(mean, std, prior, factor=1.7, **known)


def test_what_does_not_belong_together_is_refused():
    wide = PriorSummary(PRIOR.mean, 2.0 * PRIOR.std, PRIOR.lower, PRIOR.upper)
    one = estimate(0.3, 0.1)
    for others, said in (
        ([estimate(0.3, 0.1, names=("n",))], "another n: only estimates of the same"),
        ([estimate([0.3, 0.2], 0.1)], "have the shapes"),
        ([estimate(0.3, 0.1, prior=wide)], "different priors of slip"),
    ):
        with pytest.raises(InputError, match=said):
            fuse_estimates([one, *others])
    at = [replace(one, load=np.asarray(load)) for load in (60.0, 60.0, 90.0)]
    with pytest.raises(InputError, match="load"):
        fuse_estimates(at)
    with pytest.raises(InputError, match="errors on common rows: train them from one data file"):
        fuse_estimates([one, one])
    np.testing.assert_array_equal(fuse_estimates([one]).estimate.mean, one.mean)  # alone, as it is
    with pytest.raises(InputError, match="no estimate given"):
        fuse_estimates([])
