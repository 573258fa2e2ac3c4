"""An estimate given that the soil lies in a box within its prior."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from soilml.onboard.fusion.truncated_normal import BoxMoments, truncated_normal

Floats = NDArray[np.float64]

#: Standard deviation, in widths of the prior, of what the readings tell of a quantity where they
#: tell nothing.
NO_INFORMATION = 20.0
#: Share of the estimate in the box below which the readings contradict it.
LEAST_MASS = 1e-4


def within_box(
    mean: Floats,
    covariance: Floats,
    interval: Floats,
    prior: tuple[Floats, Floats],
    box: tuple[Floats, Floats],
) -> BoxMoments:
    r"""Moments and 90 % interval of q quantities of which a narrower uniform prior is known.

    What the readings tell is taken as normal: the estimate's precision less that of its uniform
    prior. Cut to the prior it should give the estimate back; the difference, which stems from an
    estimate that is not normal, is carried over to the cut by the box.

    Parameters
    ----------
    mean, covariance
        Estimate, (q,) and (q, q).
    interval
        Ends of its 90 % interval, (2, q).
    prior, box
        Ends of the uniform prior of the estimate, and of the narrower one; (q,) each.
    """
    width = prior[1] - prior[0]
    readings_mean, readings_covariance = _without_prior(mean, covariance, *prior)
    before = truncated_normal(readings_mean, readings_covariance, *prior)
    after = truncated_normal(readings_mean, readings_covariance, *box)
    least = 1e-9 * width
    scale = np.sqrt(np.diag(covariance)) / np.maximum(before.std, least)
    std = np.minimum(after.std * scale, 0.5 * (box[1] - box[0]))
    correlation = after.covariance / np.outer(*2 * (np.maximum(after.std, least),))
    shift = mean - before.mean
    # a quantity that the box fixes is not moved by what its estimate was off by
    left = np.clip(after.std / np.maximum(before.std, least), 0.0, 1.0)
    return BoxMoments(
        mean=np.clip(after.mean + left * shift, *box),
        std=std,
        covariance=correlation * np.outer(std, std),
        low=np.clip(after.low + left * (interval[0] - before.low), *box),
        high=np.clip(after.high + left * (interval[1] - before.high), *box),
        mass=after.mass / max(before.mass, 1e-300),
    )


def _without_prior(
    mean: Floats, covariance: Floats, lower: Floats, upper: Floats
) -> tuple[Floats, Floats]:
    """Mean and covariance of what the readings alone tell, as if it were normal."""
    width = upper - lower
    scaled = covariance / np.outer(width, width)
    precision = np.linalg.inv(scaled)
    own = precision - 12.0 * np.eye(len(mean))
    size, vectors = np.linalg.eigh(0.5 * (own + own.T))
    size = np.maximum(size, NO_INFORMATION**-2)
    found = (vectors / size) @ vectors.T
    pull = precision @ ((mean - lower) / width) - 12.0 * 0.5
    centre = np.clip(found @ pull, -NO_INFORMATION, NO_INFORMATION)
    return lower + width * centre, found * np.outer(width, width)
