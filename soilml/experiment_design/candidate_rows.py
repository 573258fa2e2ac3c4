"""Candidate rows: slips, loads and channels that could be measured next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.errors import InputError
from soilml.fitting.levels import replicate_rows
from soilml.physics.operating_point import MOST_SLIP, Operating
from soilml.quantities import column

Floats = NDArray[np.float64]

#: Default slips, and the number of default loads.
SLIPS = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
LOADS = 5
#: Default loads run from this multiple of the smallest measured to this of the largest.
LIGHTER, HEAVIER = 0.5, 2.0
#: Most operating points whose repetition is rated.
REPETITIONS = 6


@dataclass(frozen=True)
class CandidateRow:
    """A row to measure: slip, load (N) and channels; a repetition has a measured point."""

    slip: float
    load: float
    channels: tuple[str, ...]
    is_repetition: bool = False

    @property
    def description(self) -> str:
        """Such as: slip 0.05 at 15 N."""
        return f"slip {self.slip:.3g} at {self.load:.3g} N"


@dataclass(frozen=True)
class CandidateGrid:
    """Slips and loads (N) that can be driven, each once and ascending."""

    slips: tuple[float, ...]
    loads: tuple[float, ...]

    def __post_init__(self) -> None:
        if not self.slips or not self.loads:
            raise InputError("no slips or no loads; give at least one of each")
        for slip in self.slips:
            if not -MOST_SLIP < slip < MOST_SLIP:
                raise InputError(f"slip {slip:g} cannot be driven; needed is one inside -1..1")
        for load in self.loads:
            if not 0.0 < load < 1e7:
                raise InputError(f"load {load:g} N cannot be driven; needed is one inside 0..1e7")

    def candidates(self, channels: Sequence[tuple[str, ...]]) -> list[CandidateRow]:
        """All combinations of slip, load and channels."""
        points = [(slip, load) for slip in self.slips for load in self.loads]
        return [CandidateRow(*point, channels=own) for own in channels for point in points]


def candidate_grid(
    slips: Sequence[float] | None,
    loads: Sequence[float] | None,
    measured_loads: Floats | Sequence[float] = (),
) -> CandidateGrid:
    """The grid of given slips and loads (N); by default `SLIPS`, and loads about those measured.

    Raises `InputError` where there are neither loads nor measured loads.
    """
    if loads is None:
        if len(measured_loads) == 0:
            raise InputError("no loads and no measured rows: give --loads 30,60,120, or RUNS.csv")
        low, high = LIGHTER * float(np.min(measured_loads)), HEAVIER * float(np.max(measured_loads))
        loads = [float(f"{load:.2g}") for load in np.geomspace(low, high, LOADS)]
    return CandidateGrid(tuple(sorted({*(slips or SLIPS)})), tuple(sorted({*loads})))


def channel_sets(declared: Sequence[str]) -> list[tuple[str, ...]]:
    """The first channel with declared noise (torque), and it together with each other one."""
    if not declared:
        raise InputError("none of the measured channels has its noise declared in [noise]")
    first, *others = declared
    return [(first,), *[(first, other) for other in others]]


def channel_label(channels: Sequence[str]) -> str:
    """Column names: torque_Nm + sinkage_m."""
    return " + ".join(column(name) for name in channels)


def repeated_points(measured: Operating, channels: tuple[str, ...] = ()) -> list[CandidateRow]:
    """The operating points of rows (n,), each once; of many, `REPETITIONS` spread over all.

    The point of replicate rows is their median.
    """
    slip, load = np.atleast_1d(measured.slip), np.atleast_1d(measured.load)
    group = replicate_rows(Operating(slip=slip, load=load))
    ends = np.cumsum(np.unique(group, return_counts=True)[1])
    members = np.split(np.argsort(group, kind="stable"), ends[:-1])
    points = sorted((float(np.median(slip[i])), float(np.median(load[i]))) for i in members)
    if len(points) > REPETITIONS:
        kept = np.linspace(0, len(points) - 1, REPETITIONS).round().astype(int)
        points = [points[i] for i in kept]
    return [CandidateRow(*point, channels=channels, is_repetition=True) for point in points]
