"""From what was found to what may be said."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.gap.results import NamedEffect, Shrink, Value, Where
from soilml.gap.search.candidate_fits import Bench, Candidate
from soilml.gap.search.stepwise import Found
from soilml.gap.statistics.least_squares import GapFit
from soilml.gap.statistics.score_test import outside, scores
from soilml.gap.statistics.signatures import signatures
from soilml.gap.statistics.smooth_basis import places
from soilml.quantities import column

Floats = NDArray[np.float64]

#: Squared prior spreads that the law of one effect, or those of several, may be bent by before
#: they are other laws; several bent ones fit anything.
STRAINED, STRAINED_SEVERAL = 4.0, 1.0
#: Mean squared residual above which further bends of a law cannot be all that is missing.
UNFIT = 2.0
#: Share of the gap that may be left on runs that an explanation was not fitted to, where the gap
#: stands out there.
CARRIES, STANDS_OUT = 0.5, 2.0


def status_of(found: Found, unnameable: Sequence[str], runs: Shrink | None) -> str:
    """What may be said, see `soilml.gap.results.STATUSES`.

    An explanation that leaves more than noise, that needs a law far from any known, or that does
    not predict runs it was not fitted to, explains nothing.
    """
    if not found.gap:
        return "no-gap"
    if unnameable:
        return "not-testable"
    if not found.causes or not found.adequate:
        return "unknown"
    best = found.causes[0]
    bent = STRAINED if len(best.names) == 1 else STRAINED_SEVERAL
    if best.strain > bent or float(np.mean(best.fit.residual**2)) > UNFIT:
        return "unknown"
    carried = runs is None or runs.after - 1.0 <= CARRIES * (runs.before - 1.0)
    if runs is not None and runs.before > STANDS_OUT and not carried:
        return "unknown"
    if len(found.causes) > 1:
        return "class"
    return "form-open" if found.causes[0].open else "named"


def values_of(fit: GapFit, *, soil: bool) -> dict[str, Value]:
    """The soil parameters of a fit, or those of its effects, by path."""
    stds = fit.stds()
    return {
        axis.path: Value(value, stds[axis.path], axis.unit)
        for axis, value in zip(fit.axes, fit.values().values(), strict=True)
        if ("." not in axis.path) == soil
    }


def named(causes: Sequence[Candidate], alike: Likeness) -> list[NamedEffect]:
    """The effects of the best candidate, with what explains the data as well."""
    if not causes:
        return []
    chosen = causes[0]
    fit = chosen.fit
    parameters = values_of(fit, soil=False)
    found = []
    for name in chosen.names:
        others = {n for c in causes[1:] for n in c.names} - set(chosen.names)
        own = {
            path.rpartition(".")[2]: value
            for path, value in parameters.items()
            if path.rpartition(".")[0] == name
        }
        snr, rival = alike.separation(name, _size(fit, name))
        found.append(NamedEffect(name, own, tuple(sorted(others)), snr, rival))
    return found


def _size(fit: GapFit, name: str) -> float:
    for axis, x in zip(fit.axes, fit.x, strict=True):
        if axis.path.rpartition(".")[0] == name:
            return float(x)
    return 0.0


@dataclass(frozen=True)
class Likeness:
    """Signatures of the catalogue on these runs, soil projected off: lengths (sigma), cosines."""

    names: tuple[str, ...]
    length: Floats  # (k,)
    cosine: Floats  # (k, k), without the diagonal

    def separation(self, name: str, size: float) -> tuple[float, str]:
        """Separating signal-to-noise of an effect at a size (reference sizes), nearest rival.

        Length of its projected signature times the sine to the nearest rival's, in sigma.
        """
        if name not in self.names:
            return 0.0, ""
        i = self.names.index(name)
        rival = int(np.argmax(self.cosine[i]))
        sine = float(np.sqrt(max(0.0, 1.0 - self.cosine[i, rival] ** 2)))
        return abs(size) * float(self.length[i]) * sine, self.names[rival]

    def mimicry(self, chosen: Sequence[str]) -> float:
        """Largest cosine between a chosen effect's signature and another's."""
        mine = np.isin(self.names, chosen)
        if not mine.any() or mine.all():
            return 0.0
        return float(self.cosine[mine][:, ~mine].max())


def likeness(bench: Bench, fit: GapFit) -> Likeness:
    """How alike the catalogue's effects look on the soil of a fit."""
    soil = {path: v for path, v in fit.values().items() if "." not in path}
    known, _ = signatures(bench.case.with_values(soil), bench.cells, bench.effects)
    columns = bench.covariance.whiten @ np.stack([s.column for s in known], axis=1)
    columns = outside(columns, fit.slope[:, : len(bench.soil)])
    length = np.linalg.norm(columns, axis=0)
    unit = columns / np.where(length > 0, length, 1.0)
    cosine = np.abs(unit.T @ unit)
    np.fill_diagonal(cosine, 0.0)
    return Likeness(tuple(s.name for s in known), length, cosine)


def map_of(bench: Bench, fit: GapFit, seed: int) -> list[Where]:
    """Where the soil alone disagrees with the data, the worst corner first.

    The score is above zero where readings lie above the prediction.
    """
    corners = list(places(bench.cells))
    if not corners:
        return []
    std = bench.covariance.std
    columns = np.stack([np.where(c.cells, std, 0.0) for c in corners], axis=1)
    found = scores(
        fit.residual,
        bench.covariance.whiten @ columns,
        fit.slope,
        np.zeros(len(corners)),
        bench.covariance.scatter.freedom,
        seed,
    )
    order = np.argsort(-found.z)
    off = bench.cells.reading - fit.prediction
    side = [float(np.mean(off[c.cells] / std[c.cells])) for c in corners]
    return [
        Where(
            column(c.channel),
            c.slip,
            c.load,
            float(np.copysign(found.z[i], side[i])),
            found.p(float(found.z[i])),
        )
        for i, c in ((i, corners[i]) for i in order)
    ]
