"""Estimates of one quantity from several files, against exact Gaussian inference."""

from dataclasses import replace

import numpy as np
import pytest
from made_estimates import made_estimate

from soilml.errors import InputError
from soilml.onboard.estimate import PriorSummary
from soilml.onboard.multi_sensor import fuse_estimates

PRIOR = PriorSummary(np.asarray([0.3]), np.asarray([0.15]), np.asarray([-0.3]), np.asarray([0.9]))


def estimate(mean, std, prior=PRIOR, **known):
    mean, std = (np.asarray(x, float)[..., None] for x in np.broadcast_arrays(mean, std))
    return made_estimate(mean, std, prior, factor=1.7, **known)


def posteriors(rows=20000, noise=(0.1, 0.2)):
    """True slips drawn from the prior, and what sensors of independent errors make of them."""
    rng = np.random.default_rng(0)
    truth = rng.normal(0.3, 0.15, rows)
    found = []
    for std in noise:
        reading = truth + std * rng.normal(size=rows)
        gain = 0.15**2 / (0.15**2 + std**2)
        found.append(estimate(0.3 + gain * (reading - 0.3), np.sqrt(1.0 - gain) * 0.15))
    return truth, found


def rms(values):
    return np.sqrt(np.mean(values**2))


def test_the_prior_counts_once():
    truth, found = posteriors()
    once = fuse_estimates(found).estimate
    exact = (0.15**-2 + 0.1**-2 + 0.2**-2) ** -0.5
    np.testing.assert_allclose(once.std, exact, rtol=0.01)
    assert rms(once.mean[:, 0] - truth) == pytest.approx(exact, rel=0.02)
    inside = (once.low[:, 0] <= truth) & (truth <= once.high[:, 0])
    assert inside.mean() == pytest.approx(0.9, abs=0.01)


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
    assert fuse_estimates(at[:2]).estimate.load == 60.0
    with pytest.raises(InputError, match="load"):
        fuse_estimates(at)
    with pytest.raises(InputError, match="rule is 'best-linear'"):
        fuse_estimates([one, one], "best-linear")
    with pytest.raises(InputError, match="no estimate given"):
        fuse_estimates([])
