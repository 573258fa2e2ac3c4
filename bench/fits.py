"""The least misfit that any soil of a prior has to many sets at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from foreign import Readings
from scipy.stats import qmc

from training.set_posterior.coordinates import Coordinate
from training.set_posterior.monomials import derivative, monomials, terms

Floats = np.ndarray[Any, np.dtype[np.float64]]

#: Degree of the polynomials of three unknowns, points that fix them, and error that they leave.
DEGREE, POINTS, ERROR = 6, 512, 1e-3
#: Soils among which the search starts, and its steps.
STARTS, STEPS = 2048, 12
#: Readings below so many standard deviations have no logarithm to believe.
CLEAR = 3.0
THESE = terms(3, DEGREE)
SLOPES = [derivative(THESE, k) for k in (1, 2, 3)]


def points(count: int, seed: int) -> Floats:
    """Coordinates (count, 3) spread over the box."""
    return np.asarray(2.0 * qmc.Sobol(3, rng=seed).random(count) - 1.0)


def values(axes: Sequence[Coordinate], x: Floats) -> Floats:
    """Parameters (n, 3) at coordinates (n, 3)."""
    return np.stack([a.value(x[:, i]) for i, a in enumerate(axes)], axis=1)


def channels(r: Readings) -> Floats:
    """Logarithms of torque and sinkage, and drawbar pull, (sets, 3 ways)."""
    with np.errstate(invalid="ignore", divide="ignore"):
        logs = [np.log(np.maximum(r[name], 1e-300)) for name in ("torque", "sinkage")]
    return np.concatenate([*logs, r["drawbar_pull"]], axis=1)


def weights(r: Readings, std: Readings, used: Floats, three: bool) -> Floats:
    """One over the standard deviation of each of `channels`, 0 where it is not used."""
    with np.errstate(divide="ignore", over="ignore"):
        share = [std[k] / np.maximum(np.abs(r[k]), 1e-300) for k in ("torque", "sinkage")]
        weight = [np.where(s < 1.0 / CLEAR, 1.0 / np.hypot(s, ERROR), 0.0) for s in share]
        weight.append(1.0 / np.hypot(std["drawbar_pull"], ERROR * r["load"]))
    seen = (1.0, float(three), float(three))
    return np.concatenate([s * used * w for s, w in zip(seen, weight, strict=True)], axis=1)


@dataclass(frozen=True)
class Surface:
    """Channels as polynomials of the soil, at every way to drive: coefficients (terms, cells)."""

    coefficients: Floats

    @staticmethod
    def of(x: Floats, y: Floats) -> Surface:
        """Through channels y (n, cells) at coordinates x (n, 3); rows with NaN are left out."""
        whole = np.isfinite(y).all(axis=1)
        return Surface(np.linalg.lstsq(monomials(x[whole], THESE), y[whole], rcond=None)[0])

    def at(self, x: Floats) -> Floats:
        """Channels (n, cells)."""
        return np.asarray(monomials(x, THESE) @ self.coefficients)

    def least(self, y: Floats, w: Floats) -> Floats:
        """Least sum of squared residuals of sets (n, cells) over the box (n,)."""
        start = points(STARTS, 2)
        known = self.at(start)
        w2 = w**2
        sums = (w2 * y**2).sum(axis=1)[:, None] - 2.0 * (w2 * y) @ known.T + w2 @ known.T**2
        x, damp = start[np.argmin(sums, axis=1)], np.full(len(y), 1e-2)
        cost = self._cost(x, y, w)
        for _ in range(STEPS):
            basis = monomials(x, THESE)
            off = w * (basis @ self.coefficients - y)
            rise = np.stack([w * (basis @ d.T @ self.coefficients) for d in SLOPES], axis=1)
            free = ~((np.abs(x) >= 1.0) & (np.einsum("nkc,nc->nk", rise, off) * x < 0.0))
            rise = rise * free[..., None]
            bend = np.einsum("nkc,nlc->nkl", rise, rise)
            bend += np.eye(3) * (
                damp[:, None, None] * (1.0 + np.einsum("nkk->n", bend))[:, None, None]
            )
            step = np.linalg.solve(bend, np.einsum("nkc,nc->nk", rise, off)[..., None])[..., 0]
            new = np.clip(x - step, -1.0, 1.0)
            now = self._cost(new, y, w)
            better = now < cost
            x = np.where(better[:, None], new, x)
            cost, damp = np.where(better, now, cost), damp * np.where(better, 0.2, 8.0)
        return cost

    def _cost(self, x: Floats, y: Floats, w: Floats) -> Floats:
        return np.asarray(((w * (self.at(x) - y)) ** 2).sum(axis=1))
