"""Smallest chi-square of any soil of the prior, for many sets at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from faults import Readings
from scipy.stats import qmc

from training.set_posterior.families.coordinates import PriorAxis
from training.set_posterior.monomials import derivative, monomial_terms, monomials

Floats = np.ndarray[Any, np.dtype[np.float64]]

#: Degree of the polynomials of three unknowns, fitting points, and relative error of the fit.
DEGREE, POINTS, FIT_ERROR = 6, 512, 1e-3
#: Soils among which the search for the minimum starts, and its Levenberg-Marquardt steps.
STARTS, STEPS = 2048, 12
#: Readings below this many standard deviations are left out: their logarithm is not normal.
MIN_SNR = 3.0
TERMS = monomial_terms(3, DEGREE)
DERIVATIVES = [derivative(TERMS, k) for k in (1, 2, 3)]


def box_points(count: int, seed: int) -> Floats:
    """Quasi-random coordinates (count, 3) in the box [-1, 1]^3."""
    return np.asarray(2.0 * qmc.Sobol(3, rng=seed).random(count) - 1.0)


def parameter_values(axes: Sequence[PriorAxis], x: Floats) -> Floats:
    """Parameters (n, 3) at coordinates (n, 3)."""
    return np.stack([a.value(x[:, i]) for i, a in enumerate(axes)], axis=1)


def channels(r: Readings) -> Floats:
    """Logarithms of torque and sinkage, and drawbar pull, (sets, 3 conditions)."""
    with np.errstate(invalid="ignore", divide="ignore"):
        logs = [np.log(np.maximum(r[name], 1e-300)) for name in ("torque", "sinkage")]
    return np.concatenate([*logs, r["drawbar_pull"]], axis=1)


def weights(r: Readings, std: Readings, used: Floats, three: bool) -> Floats:
    """Reciprocal standard deviation of each of `channels`, 0 where it is not used."""
    with np.errstate(divide="ignore", over="ignore"):
        share = [std[k] / np.maximum(np.abs(r[k]), 1e-300) for k in ("torque", "sinkage")]
        weight = [np.where(s < 1.0 / MIN_SNR, 1.0 / np.hypot(s, FIT_ERROR), 0.0) for s in share]
        weight.append(1.0 / np.hypot(std["drawbar_pull"], FIT_ERROR * r["load"]))
    read = (1.0, float(three), float(three))
    return np.concatenate([s * used * w for s, w in zip(read, weight, strict=True)], axis=1)


@dataclass(frozen=True)
class ResponseSurface:
    """Channels as polynomials of the soil, per operating condition: coefficients (terms, k)."""

    coefficients: Floats

    @staticmethod
    def fit(x: Floats, y: Floats) -> ResponseSurface:
        """Least squares of channels y (n, k) at coordinates x (n, 3), without rows of NaN."""
        finite = np.isfinite(y).all(axis=1)
        return ResponseSurface(
            np.linalg.lstsq(monomials(x[finite], TERMS), y[finite], rcond=None)[0]
        )

    def predict(self, x: Floats) -> Floats:
        """Channels (n, k) at coordinates (n, 3)."""
        return np.asarray(monomials(x, TERMS) @ self.coefficients)

    def min_chi_square(self, y: Floats, w: Floats) -> Floats:
        """Smallest chi-square (n,) over the box, of channels y and weights w (n, k) of n sets.

        Levenberg-Marquardt for all sets at once, from the best of `STARTS` soils; coordinates at an
        end of the box whose gradient points outward stay fixed.
        """
        start = box_points(STARTS, 2)
        predicted = self.predict(start)
        w2 = w**2
        sums = (w2 * y**2).sum(axis=1)[:, None] - 2.0 * (w2 * y) @ predicted.T + w2 @ predicted.T**2
        x, damping = start[np.argmin(sums, axis=1)], np.full(len(y), 1e-2)
        cost = self._chi_square(x, y, w)
        for _ in range(STEPS):
            basis = monomials(x, TERMS)
            residual = w * (basis @ self.coefficients - y)
            jacobian = np.stack(
                [w * (basis @ d.T @ self.coefficients) for d in DERIVATIVES], axis=1
            )
            free = ~((np.abs(x) >= 1.0) & (np.einsum("nkc,nc->nk", jacobian, residual) * x < 0.0))
            jacobian = jacobian * free[..., None]
            hessian = np.einsum("nkc,nlc->nkl", jacobian, jacobian)
            hessian += np.eye(3) * (
                damping[:, None, None] * (1.0 + np.einsum("nkk->n", hessian))[:, None, None]
            )
            step = np.linalg.solve(hessian, np.einsum("nkc,nc->nk", jacobian, residual)[..., None])[
                ..., 0
            ]
            new = np.clip(x - step, -1.0, 1.0)
            now = self._chi_square(new, y, w)
            better = now < cost
            x = np.where(better[:, None], new, x)
            cost, damping = np.where(better, now, cost), damping * np.where(better, 0.2, 8.0)
        return cost

    def _chi_square(self, x: Floats, y: Floats, w: Floats) -> Floats:
        return np.asarray(((w * (self.predict(x) - y)) ** 2).sum(axis=1))
