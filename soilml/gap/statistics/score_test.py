"""Scores of signatures against residuals, and how surprising the largest of many is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

#: Draws for the family-wise level, and share of a signature that must survive projection.
DRAWS = 4000
SURVIVES = 1e-4


def outside(columns: Floats, space: Floats) -> Floats:
    """The part of columns (m, k) orthogonal to a space (m, p)."""
    if space.shape[1] == 0:
        return columns
    u, s, _ = np.linalg.svd(space, full_matrices=False)
    basis = u[:, s > 1e-9 * max(float(s[0]), 1e-300)]
    return np.asarray(columns - basis @ (basis.T @ columns))


@dataclass(frozen=True)
class Scores:
    """Score of each column, in standard deviations, and what chance makes of the largest."""

    z: Floats  # (k,) after the sign that a column may have
    level: Floats  # (draws,) largest score of the family in data without a gap
    length: Floats  # (k,) length of each projected column: one size's worth, in sigma
    absorbed: Floats  # (k,) share of its power that the projected-off space explains

    def p(self, z: float) -> float:
        """Probability that the family's largest score is this large by chance."""
        return float((np.sum(self.level >= z) + 1) / (len(self.level) + 1))

    @property
    def worst(self) -> float:
        """The family-wise p value of the largest score."""
        return self.p(float(self.z.max())) if self.z.size else 1.0


def scores(
    residual: Floats,
    columns: Floats,
    space: Floats,
    signs: Floats,
    freedom: float,
    seed: int,
) -> Scores:
    r"""Family-wise test of whitened residuals (m,) against whitened columns (m, k).

    .. math:: z_i = g_{\perp i} \cdot r / |g_{\perp i}|, \quad z \sim N(0, C)

    with C the cosines between the projected columns, drawn; `signs` (k,) is 0 for a column that may
    take either sign. `freedom` is that of the estimated noise: the draws are of Student's t.
    References: Westfall and Young, Resampling-Based Multiple Testing, 1993.
    """
    beyond = outside(columns, space)
    total = np.linalg.norm(columns, axis=0)
    length = np.linalg.norm(beyond, axis=0)
    alive = length > SURVIVES * np.maximum(total, 1e-300)
    unit = np.where(alive, beyond / np.where(alive, length, 1.0), 0.0)
    z = unit.T @ residual
    rng = np.random.default_rng(seed)
    draws = rng.standard_normal((DRAWS, unit.shape[0])) if unit.shape[1] > unit.shape[0] else None
    if draws is None:
        u, s, _ = np.linalg.svd(unit, full_matrices=False)
        chance = rng.standard_normal((DRAWS, s.size)) @ (u.T @ unit)
    else:
        chance = draws @ unit
    chance *= np.sqrt(freedom / rng.chisquare(freedom, DRAWS))[:, None]
    signed, chance = _signed(z, signs), _signed(chance, signs)
    chance[:, ~alive] = 0.0
    return Scores(
        z=np.where(alive, signed, 0.0),
        level=np.sort(chance.max(axis=1)) if chance.shape[1] else np.zeros(1),
        length=np.where(alive, length, 0.0),
        absorbed=1.0 - (length / np.maximum(total, 1e-300)) ** 2,
    )


def _signed(z: Floats, signs: Floats) -> Floats:
    return np.where(signs == 0, np.abs(z), signs * z)
