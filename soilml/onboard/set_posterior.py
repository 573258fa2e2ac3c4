"""Readings of one soil together, on board: the part of a model file that answers for a whole set.

The answer follows from all readings at once, whatever their order and number. What they leave is a
memory of fixed size, so that a rover can go on where it stopped.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, final

import numpy as np
import onnxruntime as ort
from numpy.typing import NDArray

from soilml.errors import InputError
from soilml.onboard.features import READABLE, readings

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Feed = dict[str, NDArray[Any]]

#: What every row brings, and what it may bring beside: a number, or NaN where it was not measured.
NEEDED = ("slip", "torque", "load")
OPTIONAL = ("sinkage", "drawbar_pull")
#: Standard deviations that may be given row by row; without them those of the file hold.
SPREADS = ("torque_std", "torque_bias", "sinkage_std", "drawbar_pull_std")
#: What may have noise.
NOISY = ("torque", *OPTIONAL, "torque_bias")
#: Outputs of the graph that make an answer, in this order, and those that make the memory.
ANSWER = ("mean", "std", "covariance", "low", "high", "in_range", "misfit")
KEPT = ("memory_out", "counted_out")
#: A channel that was not measured reads 1 with this standard deviation.
ABSENT = 1e6
#: A reading of zero with noise that is a share of it has this standard deviation, and fits nothing.
LEAST_STD = 1e-12
#: Rows of the memory beyond which it is turned into a triangle; rows of one call of the graph.
FULL, PIECE = 192, 256


@final
@dataclass(frozen=True)
class Memory:
    """What the readings so far say of the soil: a linear system in float32, and three counts.

    The counts are readings that tell something, rows, and rows inside the range. At most `FULL`
    rows of the system are kept, 60 kB, however many readings there were.
    """

    system: Singles  # (k, terms + 1)
    counted: Singles  # (3,)

    @property
    def rows(self) -> int:
        """Rows that were read."""
        return int(self.counted[1])

    def packed(self) -> Memory:
        """The same in as few rows as it has columns, where it has grown large.

        Sums of squared residuals depend on the system only through its triangular factor
        (Golub and Van Loan, Matrix Computations, section 5.3): nothing is lost.
        """
        if len(self.system) <= FULL:
            return self
        triangle: Any = np.linalg.qr(self.system.astype(np.float64), mode="r")
        return replace(self, system=triangle.astype(np.float32))


@final
@dataclass(frozen=True)
class SetPosterior:
    """The graph's inputs and outputs for sets, and the noise that the file takes for given."""

    terms: int
    noise: dict[str, tuple[float, float]]  # channel -> constant, share of the reading
    context: dict[str, tuple[float, float]]  # what holds for a set -> least and most
    given: dict[str, float]  # the same, as it was given
    alone: bool  # the file has no regressors of single readings beside it

    @staticmethod
    def of(said: Mapping[str, Any]) -> SetPosterior:
        """From the file's metadata."""
        return SetPosterior(
            terms=int(said["terms"]),
            noise={str(k): (float(v[0]), float(v[1])) for k, v in said["noise"].items()},
            context={str(k): (float(v[0]), float(v[1])) for k, v in said["context"].items()},
            given={},
            alone=bool(said["alone"]),
        )

    @property
    def needs(self) -> tuple[str, ...]:
        """What must still be given before anything is estimated."""
        return tuple(name for name in self.context if name not in self.given)

    def on(
        self, given: Mapping[str, Any], noise: Mapping[str, tuple[float, float]]
    ) -> SetPosterior:
        """With wheel, bearing, prior and noise given.

        Raises `InputError` for one that is not known or out of range.
        """
        for name, (constant, share) in noise.items():
            if name not in NOISY or not (constant >= 0.0 and share >= 0.0):
                raise InputError(
                    f"noise of {name} is {constant:g} and {share:g} of the reading; needed are two "
                    f"numbers not below zero for {', '.join(NOISY)}"
                )
        for name, value in given.items():
            if name not in self.context:
                known = ", ".join(self.context) or "nothing: the file is of one wheel"
                raise InputError(f"{name!r} cannot be given; this file takes {known}")
            low, high = self.context[name]
            if not low <= float(value) <= high:
                raise InputError(f"{name} is {value:g}; this file is for {low:g} to {high:g}")
        own = self.given | {k: float(v) for k, v in given.items()}
        return replace(self, given=own, noise=self.noise | dict(noise))

    def start(self) -> Memory:
        """The memory before anything was measured."""
        return Memory(np.zeros((0, self.terms + 1), np.float32), np.zeros(3, np.float32))

    def rows(self, measured: Mapping[str, Any]) -> dict[str, Floats]:
        """Inputs of the graph by row (m,), checked and complete.

        Raises `InputError` for a reading that is missing, not finite or impossible.
        """
        known = (*NEEDED, *OPTIONAL, *SPREADS)
        for name in measured:
            if name not in known:
                raise InputError(f"{name!r} is not read by this model; it reads {', '.join(known)}")
        own = {name: measured[name] for name in measured if name in NEEDED}
        flat, shape = readings(NEEDED, own)
        found = dict(zip(NEEDED, flat, strict=True))
        for name in OPTIONAL:
            value = _broadcast(name, measured.get(name, np.nan), shape)
            absent = np.isnan(value)
            found[name] = np.where(absent, 1.0, value)
            spread = self._spread(f"{name}_std", name, value, measured, shape)
            found[f"{name}_std"] = np.where(absent, ABSENT, spread)
        for name, kind in (("torque_std", "torque"), ("torque_bias", "torque_bias")):
            found[name] = self._spread(name, kind, found["torque"], measured, shape)
        for name in SPREADS:
            least = 0.0 if name == "torque_bias" else 1e-300
            if not (found[name] >= least).all():
                raise InputError(f"{name} is {found[name].min():g}; it must be above zero")
        return found

    def _spread(
        self,
        name: str,
        kind: str,
        reading: Floats,
        measured: Mapping[str, Any],
        shape: tuple[int, ...],
    ) -> Floats:
        """A standard deviation (m,) as it was given, or by the file's own noise."""
        if name in measured:
            return _broadcast(name, measured[name], shape)
        constant, share = self.noise.get(kind, (0.0, 0.0))
        if kind in OPTIONAL and not constant + share:
            return np.full_like(reading, ABSENT)
        least = 0.0 if name == "torque_bias" else LEAST_STD
        return np.maximum(np.hypot(constant, share * np.abs(reading)), least)

    def feed(self, rows: Mapping[str, Floats], memory: Memory) -> Feed:
        """Everything that the graph reads, by input name."""
        with np.errstate(over="ignore", under="ignore"):
            feed: Feed = {name: values.astype(np.float32) for name, values in rows.items()}
        feed |= {name: np.asarray([value], np.float32) for name, value in self.given.items()}
        if not self.alone:
            feed["joint"] = np.ones(1, np.bool_)
        return feed | {"memory": memory.system, "counted": memory.counted}

    def inside(
        self, session: ort.InferenceSession, rows: Mapping[str, Floats]
    ) -> NDArray[np.bool_]:
        """Which rows (m,) lie where the response of the wheel was learned."""
        found: NDArray[np.bool_] = session.run(("row_in_range",), self.feed(rows, self.start()))[0]
        return found

    def learned(
        self, session: ort.InferenceSession, rows: Mapping[str, Floats], memory: Memory
    ) -> tuple[list[Any], Memory]:
        """Answers of the graph, as in `ANSWER`, after rows and memory together; the new memory."""
        many = len(rows["slip"])
        for first in range(0, max(many - PIECE, 0), PIECE):
            piece = {name: values[first : first + PIECE] for name, values in rows.items()}
            memory = Memory(*session.run(KEPT, self.feed(piece, memory))).packed()
        left = (many - 1) // PIECE * PIECE if many else 0
        rest = {name: values[left:] for name, values in rows.items()}
        names = [*(f"set_{name}" for name in ANSWER), *KEPT]
        found = session.run(names, self.feed(rest, memory.packed()))
        return found[: len(ANSWER)], Memory(*found[len(ANSWER) :])


def once(rows: Mapping[str, Floats]) -> dict[str, Floats]:
    """Rows without those that repeat another in every reading: they are copies, and say nothing."""
    table = np.stack([rows[name] for name in (*NEEDED, *OPTIONAL)], axis=1)
    first: dict[bytes, int] = {}
    for i, row in enumerate(table):
        first.setdefault(row.tobytes(), i)
    if len(first) == len(table):
        return dict(rows)
    return {name: values[list(first.values())] for name, values in rows.items()}


def _broadcast(name: str, value: Any, shape: tuple[int, ...]) -> Floats:
    low, high = READABLE.get(name, (0.0, np.inf))
    array = np.asarray(value, dtype=np.float64)
    try:
        array = np.broadcast_to(array, shape).reshape(-1)
    except ValueError:
        raise InputError(f"{name} has shape {array.shape}, the readings have {shape}") from None
    if name in READABLE:
        bad = ~((array > low) & (array < high)) & ~np.isnan(array)
        if bad.any():
            raise InputError(f"{name} is {array[bad][0]:g}; needed is a finite number, or NaN")
    return array
