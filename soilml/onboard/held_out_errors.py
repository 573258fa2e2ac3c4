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

#: Keys of the metadata entry, which are the names of the arrays: of whole numbers, of single
#: readings, and by number of readings.
WHOLE, SINGLE = ("rows", "repeats"), ("truth", "mean", "std")
KEYS = (*WHOLE, *SINGLE, "repeat_std", "repeat_coverage_factor")


@dataclass(frozen=True)
class HeldOutErrors:
    """Estimates of held-out rows beside their true values, and errors of repeated readings.

    Two files that were trained from the same data have the same rows: from them follows how far
    their errors are correlated. Two objects are equal where they come from the same file.

    rows (n,): Number of each row in the data file, rising.
    truth, mean, std (n, q): True values and the file's estimates, in SI units.
    repeats (k,): Numbers of readings of one soil at one slip and load, from 1.
    repeat_std (k, q): Standard deviation of the error of their mean, over that of one: the square
        root of c + (1 - c) / m for m readings that have the share c of their error variance in
        common.
    repeat_coverage_factor (k, q): Half-width of the 90 % interval of their mean, in its own
        standard deviations.
    key: Checksum of all of these.
    """

    rows: NDArray[np.int64]
    truth: Floats
    mean: Floats
    std: Floats
    repeats: NDArray[np.int64]
    repeat_std: Floats
    repeat_coverage_factor: Floats
    key: str

    @staticmethod
    def of(entry: Mapping[str, Any]) -> HeldOutErrors:
        """From a metadata entry; the inverse of `entry`.

        Raises `KeyError`, `TypeError` or `ValueError` where it is malformed.
        """
        arrays: dict[str, Any] = {
            key: np.asarray(entry[key], dtype=np.int64 if key in WHOLE else np.float64)
            for key in KEYS
        }
        q = arrays["repeat_std"].shape[1]
        for key in SINGLE:
            arrays[key] = arrays[key].reshape(len(arrays["rows"]), q)
        if not (arrays["repeats"][0] == 1 and (arrays["std"] > 0.0).all()):
            raise ValueError("held-out errors")
        text = json.dumps([np.asarray(entry[key]).tolist() for key in KEYS])
        return HeldOutErrors(**arrays, key=hashlib.sha256(text.encode()).hexdigest())

    def entry(self) -> dict[str, Any]:
        """The metadata entry, with four significant digits."""
        found: dict[str, Any] = {}
        for key in KEYS:
            values = getattr(self, key)
            rounded = [float(f"{v:.4g}") for v in values.ravel()]
            exact = values.dtype.kind == "i"
            found[key] = values.tolist() if exact else np.reshape(rounded, values.shape).tolist()
        return found

    def common_share(self) -> Floats:
        """Share (q,) of the error variance that readings of one soil at one slip have in common.

        1 where the data had no repeated readings: they are then counted once.
        """
        m = self.repeats[-1]
        if m == 1:
            return np.ones(self.truth.shape[1])
        return np.asarray(np.clip((m * self.repeat_std[-1] ** 2 - 1.0) / (m - 1.0), 0.0, 1.0))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, HeldOutErrors) and self.key == other.key

    def __hash__(self) -> int:
        return hash(self.key)


def together(factor: Floats, errors: HeldOutErrors | None = None) -> dict[str, Any]:
    """The metadata entry "together": half-width (q,) of intervals of single rows, and errors."""
    own = {} if errors is None else {"held_out": errors.entry()}
    return {"alone": factor.tolist(), **own}
