"""Measurements that could be made next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.errors import InputError
from soilml.physics.operating_point import MOST_SLIP, Operating
from soilml.quantities import column

Floats = NDArray[np.float64]

#: Slips that are tried where none are given, and how many loads.
SLIPS = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
LOADS = 5
#: Loads that are tried: from this share of the least driven to this multiple of the greatest.
LIGHTER, HEAVIER = 0.5, 2.0
#: Points driven of which a repetition is tried.
REPEATS = 6


@dataclass(frozen=True)
class CandidateRow:
    """One row to drive: slip, load (N), and the channels read; `again` where it was driven."""

    slip: float
    load: float
    channels: tuple[str, ...]
    again: bool = False

    @property
    def said(self) -> str:
        """In words: slip 0.05 at 15 N."""
        return f"slip {self.slip:.3g} at {self.load:.3g} N"


@dataclass(frozen=True)
class CandidateGrid:
    """Slips and loads (N) that may be driven, each once and rising."""

    slips: tuple[float, ...]
    loads: tuple[float, ...]

    def __post_init__(self) -> None:
        if not self.slips or not self.loads:
            raise InputError("no slip or no load to choose from; give one of each or more")
        for slip in self.slips:
            if not -MOST_SLIP < slip < MOST_SLIP:
                raise InputError(f"a slip of {slip:g} cannot be driven; needed is one inside -1..1")
        for load in self.loads:
            if not 0.0 < load < 1e7:
                raise InputError(f"a load of {load:g} N cannot be driven; needed is one in 0..1e7")

    def candidates(self, channels: Sequence[tuple[str, ...]]) -> list[CandidateRow]:
        """All combinations."""
        points = [(slip, load) for slip in self.slips for load in self.loads]
        return [CandidateRow(*point, channels=own) for own in channels for point in points]


def candidate_grid(
    slips: Sequence[float] | None,
    loads: Sequence[float] | None,
    driven: Floats | Sequence[float] = (),
) -> CandidateGrid:
    """What was given, else `SLIPS`, and loads from half to twice those driven (N).

    Raises `InputError` where nobody says which loads.
    """
    if loads is None:
        if len(driven) == 0:
            raise InputError(
                "no row says which loads can be driven: give --loads 30,60,120, or RUNS.csv"
            )
        ends = LIGHTER * float(np.min(driven)), HEAVIER * float(np.max(driven))
        loads = [float(f"{load:.2g}") for load in np.geomspace(*ends, LOADS)]
    return CandidateGrid(tuple(sorted({*(slips or SLIPS)})), tuple(sorted({*loads})))


def channel_sets(declared: Sequence[str]) -> list[tuple[str, ...]]:
    """The first of the channels with noise declared (torque), and it with each other one."""
    if not declared:
        raise InputError("none of the channels that are read has its noise declared in [noise]")
    first, *others = declared
    return [(first,), *[(first, other) for other in others]]


def channel_words(channels: Sequence[str]) -> str:
    """Column names: torque_Nm + sinkage_m."""
    return " + ".join(column(name) for name in channels)


def repeats(driven: Operating, channels: tuple[str, ...] = ()) -> list[CandidateRow]:
    """The operating points of rows (n,), each once; of many, `REPEATS` spread over all."""
    rows = zip(np.atleast_1d(driven.slip), np.atleast_1d(driven.load), strict=True)
    points = sorted({(float(slip), float(load)) for slip, load in rows})
    if len(points) > REPEATS:
        kept = np.linspace(0, len(points) - 1, REPEATS).round().astype(int)
        points = [points[i] for i in kept]
    return [CandidateRow(*point, channels=channels, again=True) for point in points]
