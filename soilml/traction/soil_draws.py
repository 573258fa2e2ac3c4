"""Soils that may be there, each as likely as the next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.identification.free_parameters import FreeParameter
from soilml.identification.observations import Observations
from soilml.identification.posterior import settled_samples
from soilml.numerics.resampling import latin_hypercube, systematic_resampling

Floats = NDArray[np.float64]

#: Soils that are carried through the model: a 5 % quantile of as many strays by 1.1 %.
COUNT = 400


@dataclass(frozen=True)
class SoilDraws:
    """Values (n, p) of the parameters `names`, in SI units; each row is as likely as the next."""

    names: tuple[str, ...]
    values: Floats

    def of(self, case: Case, rows: NDArray[np.int64]) -> Case:
        """The case with the values of these draws as arrays of the shape of `rows`."""
        known = case.parameters()
        kept = {n: self.values[rows, i] for i, n in enumerate(self.names) if n in known}
        return case.with_values(kept)


@dataclass(frozen=True)
class PosteriorDraws:
    """Draws, how many equally weighted samples stand behind them, and the rows' misfit."""

    draws: SoilDraws
    effective: float
    #: mean squared residual over that of the declared noise
    misfit: float
    #: whether that is more than noise leaves, and noise was taken to be so much larger
    surplus: bool


def posterior_draws(
    case: Case, data: Observations, free: Sequence[FreeParameter], count: int = COUNT, seed: int = 0
) -> PosteriorDraws:
    """Soils drawn from what rows, noise and prior together allow.

    Raises `FitError` as the posterior method does: noise must be declared, and the model must
    carry the loads somewhere in the prior.
    """
    found, misfit, surplus = settled_samples(case, data, free)
    rows = systematic_resampling(found.weights, count, np.random.default_rng(seed).random())
    return PosteriorDraws(_valued(free, found.u[rows]), found.effective, misfit, surplus)


def prior_draws(free: Sequence[FreeParameter], count: int = COUNT, seed: int = 0) -> SoilDraws:
    """Soils drawn from the priors, one in each slice of every prior."""
    rng = np.random.default_rng(seed)
    return _valued(free, latin_hypercube(count, len(free), rng))


def _valued(free: Sequence[FreeParameter], u: Floats) -> SoilDraws:
    values = np.stack([f.prior.at(u[:, i]) for i, f in enumerate(free)], axis=1)
    return SoilDraws(tuple(f.path for f in free), values)
