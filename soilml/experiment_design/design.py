"""Which measurement to make next, and what it would leave open."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.errors import FitError
from soilml.experiment_design.candidate_rows import (
    CandidateGrid,
    CandidateRow,
    channel_sets,
    repeats,
)
from soilml.experiment_design.expected_variance import OUTCOMES, ExpectedVariance, expected_variance
from soilml.experiment_design.parameter_samples import ParameterSamples
from soilml.experiment_design.predicted_readings import PredictedReadings, predicted_readings
from soilml.physics.operating_point import Operating

Floats = NDArray[np.float64]
Floats32 = NDArray[np.float32]


@dataclass(frozen=True)
class RatedRow:
    """A measurement, and the width that it is expected to leave of each prior, (p,).

    `left` is the root of the expected variance over the prior's standard deviation.
    """

    candidate: CandidateRow
    left: Floats

    @property
    def overall(self) -> float:
        """Root mean square of `left` over the parameters: 1 where nothing would be known."""
        return float(np.sqrt(np.mean(self.left**2)))


@dataclass(frozen=True)
class Advice:
    """What each next measurement would leave open, and the best sequence of several.

    `now` (p,) is the width left of each prior before it. `sequence` holds the best first row, the
    best second one after it, and so on; their `left` is what remains after all so far.
    """

    names: tuple[str, ...]
    now: Floats
    choices: tuple[RatedRow, ...]
    again: tuple[RatedRow, ...]
    sequence: tuple[RatedRow, ...]
    stuck: int

    def of(self, channels: tuple[str, ...]) -> tuple[RatedRow, ...]:
        """The choices that read these channels."""
        return tuple(c for c in self.choices if c.candidate.channels == channels)

    @property
    def sets(self) -> tuple[tuple[str, ...], ...]:
        """Sets of channels among the choices, the smallest first."""
        return tuple(dict.fromkeys(c.candidate.channels for c in self.choices))

    def best(self, name: str | None = None, channels: tuple[str, ...] | None = None) -> RatedRow:
        """The choice that leaves least of one parameter, or of all on average."""
        return least(self.of(channels or self.sets[0]), self.names, name)

    def repeat(self, name: str | None = None) -> RatedRow | None:
        """The best repetition of what was driven; None where nothing was."""
        return least(self.again, self.names, name) if self.again else None


def least(choices: Sequence[RatedRow], names: Sequence[str], name: str | None) -> RatedRow:
    """The choice that leaves least of one parameter, or of all on average."""
    if name is None:
        return min(choices, key=lambda c: c.overall)
    i = list(names).index(name)
    return min(choices, key=lambda c: float(c.left[i]))


def advise(
    case: Case,
    belief: ParameterSamples,
    grid: CandidateGrid,
    *,
    driven: Operating | None = None,
    count: int = 1,
    covariates: Mapping[str, float] | None = None,
    reads: Sequence[str] | None = None,
    wanted: Sequence[str] | None = None,
    now: Floats | None = None,
    outcome_count: int = OUTCOMES,
    seed: int = 0,
) -> Advice:
    """Score every slip, load and set of channels by the variance that a row there would leave.

    `driven` are rows whose repetition is compared, `count` how many rows the sequence plans,
    `covariates` further fields of `Operating`, `reads` the channels that there are (default: those
    with declared noise), `wanted` the parameters that are looked at (default: all of the belief),
    `now` (p,) the width left of them where it is known better than by few samples. Points at which
    a twentieth of what is believed possible leaves the wheel stuck are left out, and counted. The
    sequence is greedy, each row the best after those before it; it reads the first set of channels.
    Raises `FitError` where no point is left, `InputError` where no noise is declared.

    It believes the model: where an effect is missing, the best row is not the one said here. A
    width is one expected over all that may be read; the one that comes out differs.
    """
    trial = _trial(case, belief, grid, driven, covariates or {}, wanted, now)
    sets = channel_sets([c for c in trial.ahead.channels if reads is None or c in reads])
    soils = expected_variance(belief, len(trial.ahead.channels), outcome_count, seed)
    first = trial.of(grid.candidates(sets[:1]), soils)
    if not first:
        raise FitError(
            "at each of these slips and loads some soil that is still possible would not carry the "
            "wheel: try smaller loads, or narrow [soil.prior]"
        )
    sequence, before = [least(first, trial.names, None)], None
    for step in range(1, count):
        logs = trial.logs(sequence[-1].candidate, soils)
        before = logs if before is None else before + logs
        soils = soils.with_noise(seed + step)
        second = trial.of([c.candidate for c in first], soils, before)
        sequence.append(least(second, trial.names, None))
    soils = soils.with_noise(seed)
    return Advice(
        names=trial.names,
        now=trial.now,
        choices=(*first, *trial.of(grid.candidates(sets[1:]), soils)),
        again=tuple(trial.of([] if driven is None else repeats(driven, sets[0]), soils)),
        sequence=tuple(sequence),
        stuck=len(grid.slips) * len(grid.loads) - len(first),
    )


@dataclass(frozen=True)
class _Trial:
    """What candidates are judged by: readings ahead at each point, and what is looked at."""

    names: tuple[str, ...]
    now: Floats
    looked: list[int]
    scale: Floats
    ahead: PredictedReadings
    place: dict[tuple[float, float], int]

    def logs(self, c: CandidateRow, soils: ExpectedVariance) -> Floats32:
        return soils.logs(self.ahead, c.channels, self.place[c.slip, c.load])

    def of(
        self,
        candidates: Sequence[CandidateRow],
        soils: ExpectedVariance,
        before: Floats32 | None = None,
    ) -> list[RatedRow]:
        """Those of the candidates that can be driven, after rows whose likelihood is `before`."""
        found = []
        for c in candidates:
            if self.ahead.drivable[self.place[c.slip, c.load]]:
                logs = self.logs(c, soils)
                left = soils.remaining(logs if before is None else logs + before)[self.looked]
                found.append(RatedRow(c, self.scale * np.sqrt(left)))
        return found


def _trial(
    case: Case,
    belief: ParameterSamples,
    grid: CandidateGrid,
    driven: Operating | None,
    covariates: Mapping[str, float],
    wanted: Sequence[str] | None,
    now: Floats | None,
) -> _Trial:
    """Readings at all points, those driven among them."""
    points = [(c.slip, c.load) for c in grid.candidates([()])]
    if driven is not None:
        points += [(c.slip, c.load) for c in repeats(driven)]
    place = {point: k for k, point in enumerate(dict.fromkeys(points))}
    slip, load = np.asarray(list(place)).T
    known = {key: np.full(len(place), value) for key, value in covariates.items()}
    ahead = predicted_readings(case, belief, Operating(slip=slip, load=load, **known))
    every = [f.path for f in belief.free]
    names = tuple(wanted or every)
    looked = [every.index(name) for name in names]
    left = belief.left[looked]
    now = left if now is None else now
    return _Trial(names, now, looked, now / left, ahead, place)
