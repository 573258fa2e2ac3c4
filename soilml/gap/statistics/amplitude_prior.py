"""Prior distribution of the amplitude of a smooth discrepancy, on a grid."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: Amplitudes of the discrepancy that are tried, in usual ones: none, then steps of a factor of
#: about 1.6, which change the evidence by less than 1 near its maximum.
AMPLITUDES = np.asarray([0.0, 0.15, 0.25, 0.4, 0.6, 1.0, 1.6, 2.5, 4.0, 6.3, 10.0, 16.0, 25.0])
#: Prior probability that a channel has no discrepancy at all.
NO_DISCREPANCY = 0.5
#: Prior probability that the discrepancy of a channel has a cause which the catalogue lacks, and
#: the scale of its amplitude, in usual ones: 20 % of a range.
UNKNOWN_CAUSE, UNKNOWN_SCALE = 0.02, 10.0


def _amplitude_masses() -> Floats:
    """Prior probability of each of `AMPLITUDES`.

    With probability `NO_DISCREPANCY` a channel has none. Otherwise its amplitude is exponentially
    distributed with a mean of one usual amplitude, or, with probability `UNKNOWN_CAUSE`, that of a
    cause which the catalogue lacks: half-Cauchy with the scale `UNKNOWN_SCALE`, whose heavy tail
    does not reward effects that explain a part of it (Gelman, Bayesian Analysis 1(3), 2006).
    """
    positive = AMPLITUDES[1:]
    edges = np.concatenate([[0.0], np.sqrt(positive[1:] * positive[:-1]), [np.inf]])
    usual, unknown = 1.0 - np.exp(-edges), 2.0 / np.pi * np.arctan(edges / UNKNOWN_SCALE)
    cumulative = (1.0 - UNKNOWN_CAUSE) * usual + UNKNOWN_CAUSE * unknown
    return np.concatenate([[NO_DISCREPANCY], (1.0 - NO_DISCREPANCY) * np.diff(cumulative)])


#: -2 ln of the prior probability of each of `AMPLITUDES`.
_AMPLITUDE_PENALTY = -2.0 * np.log(_amplitude_masses())


def amplitude_penalty(amplitudes: Floats) -> Floats:
    """-2 ln prior probability of amplitudes (b, channels) out of `AMPLITUDES`, by set, (b,)."""
    nearest = np.abs(amplitudes[..., None] - AMPLITUDES).argmin(axis=-1)
    return np.asarray(_AMPLITUDE_PENALTY[nearest].sum(axis=-1))
