"""Samples of the exact posterior of the soil, given readings."""

from __future__ import annotations

import numpy as np
from lunar.sweep import Floats, table

from soilml import Case
from soilml.fitting.coordinates import select_free
from soilml.identification import usable_readings
from soilml.identification.posterior import posterior_samples


def posterior(
    case: Case, slip: Floats, torque: Floats, load: Floats, rng: np.random.Generator, count: int
) -> Floats:
    """`count` posterior samples (count, p) of the soil's p parameters, given readings (r,) on it.

    Drawn from the weighted samples of `soilml identify --method posterior`.
    """
    free = select_free(case, None)
    found = posterior_samples(case, usable_readings(case, table(slip, torque, load)), free).sample
    drawn = found.u[rng.choice(len(found.u), count, p=found.weights)]
    return np.stack([f.prior.at(drawn[:, k]) for k, f in enumerate(free)], axis=1)
