"""Which run or check would tell the remaining explanations apart."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from soilml.errors import InputError
from soilml.gap.data.observations import Cells
from soilml.gap.design.run_options import CHECKS, cells_at, menu
from soilml.gap.results import NextRun
from soilml.gap.search.candidate_fits import Bench, Candidate
from soilml.gap.search.cross_validation import spread
from soilml.gap.statistics.coordinates import linearised, predicted
from soilml.gap.statistics.least_squares import GapFit
from soilml.physics.operating_point import COVARIATES
from soilml.quantities import column

Floats = NDArray[np.float64]

#: Sigma beyond which two explanations are as far apart as anybody needs.
ENOUGH = 10.0
#: Suggestions that are listed.
LISTED = 8


def next_runs(bench: Bench, rivals: Sequence[Candidate]) -> list[NextRun]:
    """Runs and checks, ranked by how well they separate the first explanation from the others.

    With one explanation alone, nothing is left to separate. What a run would say is judged against
    a rival that adapts all its parameters to old and new rows together.
    """
    if len(rivals) < 2:
        return []
    fits = {"+".join(c.names): c.fit for c in rivals[:5]}
    one, *others = fits.values()
    known = [_compared(one, other, bench.cells, bench.covariance.whiten) for other in others]
    found = []
    for option in menu(bench.cells):
        try:
            cells = cells_at(option, bench.cells, one.fitted())
            whiten = spread(bench, one, cells).whiten
            apart = [
                _apart(other, old, _compared(one, other, cells, whiten))
                for other, old in zip(others, known, strict=True)
            ]
        except (InputError, np.linalg.LinAlgError):
            continue
        if not np.isfinite(apart).all():
            continue
        found.append(NextRun(option.kind, option.text, _worth(apart), _rows(cells, fits)))
    for kind, (text, after) in CHECKS.items():
        apart = [_checked(one, other, after) for other in others]
        if max(apart) > 0.0:
            found.append(NextRun(kind, text, _worth(apart), ()))
    return sorted(found, key=lambda run: -run.separates)[:LISTED]


def _worth(apart: Sequence[float]) -> float:
    """Sigma between the first explanation and the others, on average, each up to `ENOUGH`."""
    return float(np.mean([min(sigma, ENOUGH) for sigma in apart]))


#: Difference and slope, whitened.
Compared = tuple[Floats, Floats]


def _compared(one: GapFit, other: GapFit, cells: Cells, whiten: Floats) -> Compared:
    """Whitened difference (m,) of two explanations on some cells, and the other's slope (m, p)."""
    mine = predicted(one.case, one.axes, one.x[None, :], cells)[0]
    theirs, slope = linearised(other.case, other.axes, other.x, cells)
    return whiten @ (mine - theirs), whiten @ slope


def _apart(other: GapFit, old: Compared, new: Compared) -> float:
    """Sigma that a run adds between two explanations, the other one adapting itself to all rows."""
    return float(np.sqrt(max(_left(other, [old, new]) - _left(other, [old]), 0.0)))


def _left(other: GapFit, parts: Sequence[Compared]) -> float:
    """Squared sigma between one explanation and the best that another can do about it."""
    held = np.diag([1.0 / axis.std for axis in other.axes])
    difference = np.concatenate([*[d for d, _ in parts], -other.x * np.diag(held)])
    slope = np.vstack([*[s for _, s in parts], held])
    if not (np.isfinite(difference).all() and np.isfinite(slope).all()):
        return float("nan")
    step = np.linalg.lstsq(slope, difference, rcond=1e-10)[0]
    return float(np.sum((difference - slope @ step) ** 2))


def _checked(one: GapFit, other: GapFit, after: dict[str, float]) -> float:
    """Sigma by which a check of the sensors would reject one of two explanations."""
    found = 0.0
    for fit in (one, other):
        for axis, value in zip(fit.axes, fit.values().values(), strict=True):
            name, _, parameter = axis.path.rpartition(".")
            if name in after and parameter not in ("by_slip", "by_load"):
                found = max(found, abs(value) / after[name])
    return found


def _rows(cells: Cells, fits: dict[str, GapFit]) -> tuple[dict[str, float], ...]:
    """Operating points of a run and what each explanation expects there."""
    rows = len(cells.run)
    columns: dict[str, Floats] = {
        "slip": np.asarray(cells.at.slip),
        "load_N": np.asarray(cells.at.load),
    }
    for field, key in COVARIATES.items():
        if getattr(cells.at, field) is not None:
            columns[key] = np.broadcast_to(getattr(cells.at, field), (rows,))
    for name, fit in fits.items():
        y = predicted(fit.case, fit.axes, fit.x[None, :], cells)[0]
        for i, channel in enumerate(cells.channels):
            columns[f"{column(channel)} if {name}"] = y[cells.channel == i]
    return tuple({key: float(values[r]) for key, values in columns.items()} for r in range(rows))
