"""Scores of columns against residuals, their p values, and how similar signatures are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats
from soilml.numerics.subspaces import project_out


def scores(residual: Floats, columns: Floats, space: Floats) -> Floats:
    r"""Score (k,) of each whitened column (m, k) against whitened residuals (m,).

    .. math:: z_i = g_{\perp i} \cdot r / |g_{\perp i}|

    space (m, p): Directions that are projected out of the columns. A column in their span has the
        score zero.

    References: Rao, Proc. Cambridge Phil. Soc. 44, 1948.
    """
    projected = project_out(columns, space)
    norm, whole = np.linalg.norm(projected, axis=0), np.linalg.norm(columns, axis=0)
    testable = norm > 1e-4 * np.maximum(whole, 1e-300)
    return np.where(testable, projected.T @ residual / np.where(testable, norm, 1.0), 0.0)


def family_wise_p(z: float, count: int) -> float:
    """Probability that the largest of so many independent normal scores is as far from zero.

    References: Sidak, Journal of the American Statistical Association 62, 1967; correlated scores
    make it an upper bound.
    """
    from scipy.special import ndtr

    p = -np.expm1(count * np.log1p(-2.0 * ndtr(-abs(z))))
    return max(float(p), float(np.finfo(float).tiny))


def chi_square_tail(value: float, degrees_of_freedom: float) -> float:
    """Probability that a chi-square variable is above a value."""
    from scipy.special import chdtrc

    return float(chdtrc(degrees_of_freedom, value))


@dataclass(frozen=True)
class SignatureSimilarity:
    """Norms (sigma) and cosines of the catalogue's signatures, with the soil projected out."""

    names: tuple[str, ...]
    norm: Floats  # (k,)
    cosine: Floats  # (k, k), absolute, with a zero diagonal

    @staticmethod
    def beside(space: Floats, columns: Mapping[str, Floats]) -> SignatureSimilarity:
        """Of whitened signatures (m,) by name, `space` (m, p) projected out."""
        projected = project_out(np.stack(list(columns.values()), axis=1), space)
        norm = np.linalg.norm(projected, axis=0)
        unit = projected / np.where(norm > 0, norm, 1.0)
        cosine = np.abs(unit.T @ unit)
        np.fill_diagonal(cosine, 0.0)
        return SignatureSimilarity(tuple(columns), norm, cosine)

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
