"""Which measurement to make next, and what it would leave open."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.advice.belief import Belief
from soilml.advice.candidate import Candidate, Grid, channel_sets, repeats
from soilml.advice.foreseen import Foreseen, foreseen
from soilml.advice.remaining import OUTCOMES, Outcomes, outcomes
from soilml.case import Case
from soilml.errors import FitError
from soilml.operating import Operating

Floats = NDArray[np.float64]
Floats32 = NDArray[np.float32]


@dataclass(frozen=True)
class Choice:
    """A measurement, and the width that it is expected to leave of each prior, (p,).

    `left` is the root of the expected variance over the prior's standard deviation.
    """

    candidate: Candidate
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
    choices: tuple[Choice, ...]
    again: tuple[Choice, ...]
    sequence: tuple[Choice, ...]
    stuck: int

    def of(self, channels: tuple[str, ...]) -> tuple[Choice, ...]:
        """The choices that read these channels."""
        return tuple(c for c in self.choices if c.candidate.channels == channels)

    @property
    def sets(self) -> tuple[tuple[str, ...], ...]:
        """Sets of channels among the choices, the smallest first."""
        return tuple(dict.fromkeys(c.candidate.channels for c in self.choices))

    def best(self, name: str | None = None, channels: tuple[str, ...] | None = None) -> Choice:
        """The choice that leaves least of one parameter, or of all on average."""
        return least(self.of(channels or self.sets[0]), self.names, name)

    def repeat(self, name: str | None = None) -> Choice | None:
        """The best repetition of what was driven; None where nothing was."""
        return least(self.again, self.names, name) if self.again else None


def least(choices: Sequence[Choice], names: Sequence[str], name: str | None) -> Choice:
    """The choice that leaves least of one parameter, or of all on average."""
    if name is None:
        return min(choices, key=lambda c: c.overall)
    i = list(names).index(name)
    return min(choices, key=lambda c: float(c.left[i]))


def advise(
    case: Case,
    belief: Belief,
    grid: Grid,
    *,
    driven: Operating | None = None,
    count: int = 1,
    covariates: Mapping[str, float] | None = None,
    reads: Sequence[str] | None = None,
    now: Floats | None = None,
    outcome_count: int = OUTCOMES,
    seed: int = 0,
) -> Advice:
    """Score every slip, load and set of channels by the variance that a row there would leave.

    `driven` are rows whose repetition is compared, `count` how many rows the sequence plans,
    `covariates` further fields of `Operating`, `reads` the channels that there are (default: those
    with declared noise), `now` (p,) the width left where it is known better than by the belief's
    few samples. Points at which a soil that is believed possible leaves the wheel stuck
    are left out, and counted. The sequence is greedy, each row the best after those before it; it
    reads the first set of channels. Raises `FitError` where no point is left, `InputError` where no
    noise is declared.

    It believes the model: where an effect is missing, the best row is not the one said here. A
    width is one expected over all that may be read; the one that comes out differs.
    """
    ahead, place = _ahead(case, belief, grid, driven, covariates or {})
    sets = channel_sets([c for c in ahead.channels if reads is None or c in reads])
    now = belief.left if now is None else now
    scale = now / belief.left
    soils = outcomes(belief, len(ahead.channels), outcome_count, seed)

    def tried(
        candidates: Sequence[Candidate], own: Outcomes, before: Floats32 | None = None
    ) -> list[Choice]:
        found = []
        for c in candidates:
            point = place[c.slip, c.load]
            if ahead.drivable[point]:
                logs = own.logs(ahead, c.channels, point)
                left = own.remaining(logs if before is None else logs + before)
                found.append(Choice(c, scale * np.sqrt(left)))
        return found

    names = tuple(f.path for f in belief.free)
    candidates = grid.candidates(sets)
    again = tried([] if driven is None else repeats(driven, sets[0]), soils)
    choices = tried(candidates, soils)
    if not choices:
        raise FitError(
            "at none of these slips and loads does the wheel rest on every soil that is still "
            "possible: try smaller loads, or narrow [soil.prior]"
        )
    sequence, before = [least(choices[: len(choices) // len(sets)], names, None)], None
    for step in range(1, count):
        last = sequence[-1].candidate
        logs = soils.logs(ahead, last.channels, place[last.slip, last.load])
        before = logs if before is None else before + logs
        soils = soils.with_noise(seed + step)
        one_set = [c for c in candidates if c.channels == sets[0]]
        sequence.append(least(tried(one_set, soils, before), names, None))
    return Advice(
        names=names,
        now=now,
        choices=tuple(choices),
        again=tuple(again),
        sequence=tuple(sequence),
        stuck=sum(not ahead.drivable[place[c.slip, c.load]] for c in candidates) // len(sets),
    )


def _ahead(
    case: Case,
    belief: Belief,
    grid: Grid,
    driven: Operating | None,
    covariates: Mapping[str, float],
) -> tuple[Foreseen, dict[tuple[float, float], int]]:
    """Predictions at all points, those driven among them, and where each point stands."""
    points = [(c.slip, c.load) for c in grid.candidates([()])]
    if driven is not None:
        points += [(c.slip, c.load) for c in repeats(driven)]
    place = {point: k for k, point in enumerate(dict.fromkeys(points))}
    slip, load = np.asarray(list(place)).T
    known = {key: np.full(len(place), value) for key, value in covariates.items()}
    return foreseen(case, belief, Operating(slip=slip, load=load, **known)), place
