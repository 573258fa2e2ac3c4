"""What is stored of a posterior: moments, quantiles, and how it relates to the truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: Quantiles that are stored: ends of the 90 % and of the 50 % interval.
FRACTIONS = (0.05, 0.25, 0.75, 0.95)
#: Posterior draws that estimate the HPD level of the truth: its resolution is 1/200.
HPD_DRAWS = 200


@dataclass(frozen=True)
class PosteriorSummary:
    r"""The posterior of one set: mean (q,), covariance (q, q), quantiles (4, q), and diagnostics.

    `log_density` is the logarithm of the posterior density at the truth, of the parameters as
    fractions of their priors, exact but for the Monte Carlo error of the evidence:

    .. math:: \log p(\theta^* | y) = \log p(y | \theta^*) - \log \int p(y | \theta) d\theta

    `hpd_level` is the share of the posterior with a higher density than the truth: the truth lies
    in the 90 % highest-posterior-density region where it is below 0.9. `flagged`: the residuals at
    the best sample exceed what noise produces once in a thousand sets, or sampling failed.
    """

    mean: Floats
    covariance: Floats
    quantiles: Floats
    log_density: float
    hpd_level: float
    flagged: bool
