"""How similar the signatures of effects are, with the soil projected out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats
from soilml.numerics.subspaces import project_out


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
