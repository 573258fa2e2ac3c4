"""Errors of a model file on rows that it was not trained on, carried in its metadata."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.onboard.set_contract import Floats

KEYS = ("rows", "truth", "mean", "std")  # Of the metadata entry; former files have more


@dataclass(frozen=True)
class HeldOutErrors:
    """Estimates of held-out rows beside their true values.

    Two files that were trained from the same data have the same rows: from them follows how far
    their errors are correlated. Two objects are equal where they come from the same file.

    rows (n,): Number of each row in the data file, rising.
    truth, mean, std (n, q): True values and the file's estimates, in SI units.
    key: Checksum of all of these.
    """

    rows: NDArray[np.int64]
    truth: Floats
    mean: Floats
    std: Floats
    key: str

    @staticmethod
    def of(entry: Mapping[str, Any]) -> HeldOutErrors:
        """From a metadata entry; the inverse of `entry`.

        Raises `KeyError`, `TypeError` or `ValueError` where it is malformed.
        """
        rows = np.asarray(entry["rows"], dtype=np.int64)
        truth, mean, std = (
            np.asarray(entry[key], dtype=np.float64).reshape(len(rows), -1) for key in KEYS[1:]
        )
        if not (truth.shape == mean.shape == std.shape and (std > 0.0).all()):
            raise ValueError("held-out errors")
        text = json.dumps([np.asarray(entry[key]).tolist() for key in KEYS])
        return HeldOutErrors(rows, truth, mean, std, hashlib.sha256(text.encode()).hexdigest())

    def entry(self) -> dict[str, Any]:
        """The metadata entry, with four significant digits."""
        found: dict[str, Any] = {"rows": self.rows.tolist()}
        for key in KEYS[1:]:
            values = getattr(self, key)
            rounded = [float(f"{v:.4g}") for v in values.ravel()]
            found[key] = np.reshape(rounded, values.shape).tolist()
        return found

    def __eq__(self, other: object) -> bool:
        return isinstance(other, HeldOutErrors) and self.key == other.key

    def __hash__(self) -> int:
        return hash(self.key)


def together(factor: Floats, errors: HeldOutErrors | None = None) -> dict[str, Any]:
    """The metadata entry "together": half-width (q,) of intervals of single rows, and errors."""
    own = {} if errors is None else {"held_out": errors.entry()}
    return {"alone": factor.tolist(), **own}
