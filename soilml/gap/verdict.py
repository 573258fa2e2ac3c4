"""From what was found to what may be said."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from soilml.gap.candidate import Bench, Candidate
from soilml.gap.fit import GapFit
from soilml.gap.report import NamedEffect, Shrink, Value, Where
from soilml.gap.score import outside, scores
from soilml.gap.search import Found
from soilml.gap.signatures import signatures
from soilml.gap.smooth import places
from soilml.quantities import column

Floats = NDArray[np.float64]

#: Squared prior spreads that a law may be bent by before it is another one.
STRAINED = 6.0
#: Share of the gap that may be left on runs that an explanation was not fitted to.
CARRIES = 0.5


def status_of(found: Found, unnameable: Sequence[str], runs: Shrink | None) -> str:
    """What may be said, see `soilml.gap.report.STATUSES`.

    An explanation that leaves more than noise, that needs a law far from any known, or that does
    not predict runs it was not fitted to, explains nothing.
    """
    if not found.gap:
        return "no-gap"
    if unnameable:
        return "not-testable"
    if not found.causes or not found.adequate or found.causes[0].strain > STRAINED:
        return "unknown"
    if runs is not None and runs.after - 1.0 > CARRIES * (runs.before - 1.0) > 0.0:
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


def named(bench: Bench, causes: Sequence[Candidate]) -> list[NamedEffect]:
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
        snr, rival = separation(bench, fit, name, float(_size(fit, name)))
        found.append(NamedEffect(name, own, tuple(sorted(others)), snr, rival))
    return found


def _size(fit: GapFit, name: str) -> float:
    for axis, x in zip(fit.axes, fit.x, strict=True):
        if axis.path.rpartition(".")[0] == name:
            return float(x)
    return 0.0


def separation(bench: Bench, fit: GapFit, name: str, size: float) -> tuple[float, str]:
    """Separating signal-to-noise of an effect at a size (reference sizes), and its nearest rival.

    Length of its projected signature times the sine to the nearest rival's, in sigma.
    """
    case = bench.case.with_values(
        {
            a.path: v
            for a, v in zip(fit.axes, fit.values().values(), strict=True)
            if "." not in a.path
        }
    )
    known, _ = signatures(case, bench.cells, bench.effects)
    names = [s.name for s in known]
    if name not in names:
        return 0.0, ""
    soil = fit.slope[:, : len(bench.soil)]
    columns = outside(bench.covariance.whiten @ np.stack([s.column for s in known], axis=1), soil)
    length = np.linalg.norm(columns, axis=0)
    unit = columns / np.where(length > 0, length, 1.0)
    i = names.index(name)
    cosine = np.abs(unit.T @ unit[:, i])
    cosine[i] = 0.0
    rival = int(np.argmax(cosine))
    sine = float(np.sqrt(max(0.0, 1.0 - cosine[rival] ** 2)))
    return abs(size) * float(length[i]) * sine, names[rival]


def mimicry(bench: Bench, found: Found) -> float:
    """Largest cosine between the best cause's signature and another's, soil projected off."""
    if not found.causes:
        return 0.0
    fit = found.causes[0].fit
    known, _ = signatures(found.soil.fitted(), bench.cells, bench.effects)
    columns = bench.covariance.whiten @ np.stack([s.column for s in known], axis=1)
    columns = outside(columns, fit.slope[:, : len(bench.soil)])
    unit = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    mine = [s.name in found.causes[0].names for s in known]
    if not any(mine) or all(mine):
        return 0.0
    cosine = np.abs(unit[:, mine].T @ unit[:, ~np.asarray(mine)])
    return float(cosine.max())


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
