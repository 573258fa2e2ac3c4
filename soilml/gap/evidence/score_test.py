"""Directions beside the soil: how similar they are, and a family-wise score test of residuals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats
from soilml.numerics.subspaces import project_out

#: Draws of the null distribution: the smallest p value is 1/4001, well below every level used.
DRAWS = 4000
#: A column of which less than this fraction of its norm remains after projection cannot be tested.
MIN_PROJECTED_FRACTION = 1e-4


TINY = 1e-300  # Smallest probability of a score, so that its normal score is finite


@dataclass(frozen=True)
class ScoreTest:
    """Score of each of k columns, and the null distribution of the largest score."""

    z: Floats  # (k,) in standard deviations, with the sign constraint of each column
    null_maxima: Floats  # (draws,) largest score under the null hypothesis, sorted
    projected_norm: Floats  # (k,) norm after projection: expected score at unit size
    absorbed: Floats  # (k,) fraction of the squared norm that the projection removes

    def p_value(self, z: float) -> float:
        """Probability that the largest score is at least this large under the null hypothesis."""
        exceeding = np.sum(self.null_maxima >= z)
        return float((exceeding + 1) / (len(self.null_maxima) + 1))

    @property
    def family_wise_p(self) -> float:
        """Family-wise p value of the largest score."""
        return self.p_value(float(self.z.max())) if self.z.size else 1.0


def score_test(
    residual: Floats,
    columns: Floats,
    space: Floats,
    signs: Floats,
    degrees_of_freedom: float,
    seed: int,
    own_degrees: Floats | None = None,
) -> ScoreTest:
    r"""Score test of whitened residuals against each of many whitened columns.

    .. math:: z_i = g_{\perp i} \cdot r / |g_{\perp i}|, \quad z \sim N(0, C)

    with C the cosines between the projected columns. The null distribution of the largest score is
    sampled.

    residual : array (m,)
    columns : array (m, k)
    space (m, p): Directions that are projected out of the columns.
    signs (k,): 1 or -1 for a column whose coefficient can only have that sign, else 0.
    degrees_of_freedom: Of the noise estimate; the draws are from Student's t distribution.
    References: Westfall and Young, Resampling-Based Multiple Testing, 1993.
    """
    projected = project_out(columns, space)
    norm = np.linalg.norm(columns, axis=0)
    projected_norm = np.linalg.norm(projected, axis=0)
    testable = projected_norm > MIN_PROJECTED_FRACTION * np.maximum(norm, 1e-300)
    unit = np.where(testable, projected / np.where(testable, projected_norm, 1.0), 0.0)
    z = unit.T @ residual
    if own_degrees is not None:
        z = _as_normal(z, own_degrees)
    z = _with_sign(z, signs)
    null = _with_sign(_null_scores(unit, degrees_of_freedom, seed), signs)
    null[:, ~testable] = 0.0
    return ScoreTest(
        z=np.where(testable, z, 0.0),
        null_maxima=np.sort(null.max(axis=1)) if null.shape[1] else np.zeros(1),
        projected_norm=np.where(testable, projected_norm, 0.0),
        absorbed=1.0 - (projected_norm / np.maximum(norm, 1e-300)) ** 2,
    )


def _as_normal(z: Floats, degrees_of_freedom: Floats) -> Floats:
    """Normal scores of the same probability as scores (k,) of Student's t distribution."""
    from scipy.special import ndtri, stdtr

    few = np.isfinite(degrees_of_freedom)
    tail = stdtr(np.where(few, degrees_of_freedom, 1.0), -np.abs(z))
    return np.where(few, -np.sign(z) * ndtri(np.maximum(tail, TINY)), z)


def _null_scores(unit: Floats, degrees_of_freedom: float, seed: int) -> Floats:
    """Scores (draws, k) of unit columns (m, k) under the null hypothesis."""
    rng = np.random.default_rng(seed)
    if unit.shape[1] > unit.shape[0]:
        scores = rng.standard_normal((DRAWS, unit.shape[0])) @ unit
    else:  # fewer columns than readings: draw in the column space
        u, s, _ = np.linalg.svd(unit, full_matrices=False)
        scores = rng.standard_normal((DRAWS, s.size)) @ (u.T @ unit)
    scores *= np.sqrt(degrees_of_freedom / rng.chisquare(degrees_of_freedom, DRAWS))[:, None]
    return np.asarray(scores)


def _with_sign(z: Floats, signs: Floats) -> Floats:
    """Scores in the direction that each column may take: absolute values where both are allowed."""
    return np.where(signs == 0, np.abs(z), signs * z)


@dataclass(frozen=True)
class SignatureSimilarity:
    """Norms (sigma) and cosines of the catalogue's signatures, with the soil projected out."""

    names: tuple[str, ...]
    norm: Floats  # (k,)
    cosine: Floats  # (k, k), absolute, with a zero diagonal

    @staticmethod
    def beside(space: Floats, names: Sequence[str], columns: Floats) -> SignatureSimilarity:
        """Of whitened signatures (m, k), with the columns of `space` (m, p) projected out."""
        projected = project_out(columns, space)
        norm = np.linalg.norm(projected, axis=0)
        unit = projected / np.where(norm > 0, norm, 1.0)
        cosine = np.abs(unit.T @ unit)
        np.fill_diagonal(cosine, 0.0)
        return SignatureSimilarity(tuple(names), norm, cosine)

    def separation(self, name: str, size: float) -> tuple[float, str]:
        """Separating signal-to-noise ratio of an effect at a size, and its nearest rival.

        Norm of the effect's projected signature times the sine of the angle to the nearest
        rival's, in sigma; `size` is in reference sizes.
        """
        if name not in self.names:
            return 0.0, ""
        i = self.names.index(name)
        rival = int(np.argmax(self.cosine[i]))
        sine = float(np.sqrt(max(0.0, 1.0 - self.cosine[i, rival] ** 2)))
        return abs(size) * float(self.norm[i]) * sine, self.names[rival]

    def largest_cosine(self, names: Sequence[str]) -> float:
        """Largest cosine between the signature of one of these effects and that of another."""
        chosen = np.isin(self.names, names)
        if not chosen.any() or chosen.all():
            return 0.0
        return float(self.cosine[chosen][:, ~chosen].max())
