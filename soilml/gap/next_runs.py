"""Which run or check would tell the remaining explanations apart."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from soilml.errors import InputError
from soilml.gap.candidate import Bench, Candidate
from soilml.gap.cells import Cells
from soilml.gap.fit import GapFit
from soilml.gap.menu import CHECKS, cells_at, menu
from soilml.gap.predict import linearised, predicted
from soilml.gap.report import NextRun
from soilml.gap.shrink import spread
from soilml.operating import COVARIATES
from soilml.quantities import column

Floats = NDArray[np.float64]

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
    names = list(fits)
    found = []
    for option in menu(bench.cells):
        try:
            cells = cells_at(option, bench.cells, fits[names[0]].fitted())
            apart = [_apart(bench, fits[names[0]], fits[n], cells) for n in names[1:]]
        except (InputError, np.linalg.LinAlgError):
            continue
        if not np.isfinite(apart).all():
            continue
        found.append(NextRun(option.kind, option.text, min(apart), _rows(cells, fits)))
    for kind, (text, after) in CHECKS.items():
        apart = [_checked(fits[names[0]], fits[n], after) for n in names[1:]]
        if min(apart) > 0.0:
            found.append(NextRun(kind, text, min(apart), ()))
    return sorted(found, key=lambda run: -run.separates)[:LISTED]


def _apart(bench: Bench, one: GapFit, other: GapFit, cells: Cells) -> float:
    """Sigma that a run adds between two explanations, the other one adapting itself to all rows."""
    known = (bench.cells, bench.covariance.whiten)
    new = (cells, spread(bench, one, cells).whiten)
    after, before = _distance(one, other, [known, new]), _distance(one, other, [known])
    return float(np.sqrt(max(after**2 - before**2, 0.0)))


def _distance(one: GapFit, other: GapFit, parts: Sequence[tuple[Cells, Floats]]) -> float:
    """Sigma between what one explanation predicts of some cells and the best that another can."""
    white, slopes = [], []
    for part, whiten in parts:
        mine = predicted(one.case, one.axes, one.x[None, :], part)[0]
        theirs, slope = linearised(other.case, other.axes, other.x, part)
        white.append(whiten @ (mine - theirs))
        slopes.append(whiten @ slope)
    held = np.diag([1.0 / axis.std for axis in other.axes])
    pull = -other.x * np.diag(held)
    difference = np.concatenate([*white, pull])
    slope = np.vstack([*slopes, held])
    step = np.linalg.lstsq(slope, difference, rcond=1e-10)[0]
    return float(np.linalg.norm(difference - slope @ step))


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
