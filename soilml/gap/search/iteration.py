"""One analysis: gate, covariance, soil alone, search, and once more with what was learned."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.gap.data.observations import Cells
from soilml.gap.search.candidate_fits import Bench, coordinates
from soilml.gap.search.stepwise import Found, search
from soilml.gap.statistics.coordinates import soil_axis
from soilml.gap.statistics.least_squares import GapFit
from soilml.gap.statistics.outliers import MOST_OUTLIERS, outliers
from soilml.gap.statistics.reml_covariance import (
    SCATTER,
    Covariance,
    Scatter,
    assembled,
    estimated,
    scatter_columns,
)
from soilml.gap.statistics.signatures import Signature, signatures
from soilml.gap.statistics.smooth_basis import smooth_columns
from soilml.identification.free_parameters import FreeParameter
from soilml.physics.effects.base import Effect
from soilml.quantities import column

Floats = NDArray[np.float64]

#: Passes of covariance, strays and search: each knows what the one before has found.
PASSES = 3


@dataclass(frozen=True)
class Analysis:
    """The bench that was used in the end, what was found on it, and what was set aside."""

    bench: Bench
    found: Found
    strays: tuple[str, ...]
    refused: str = ""


def analysed(
    case: Case,
    free: Sequence[FreeParameter],
    cells: Cells,
    effects: Mapping[str, type[Effect]],
    calibration: Mapping[str, float],
    seed: int,
    place: Callable[[int], str],
) -> Analysis:
    """Search the cells for what the soil alone does not explain.

    `place` says where a row stands, for messages.
    """
    axes = tuple(soil_axis(f) for f in free)
    nominal = np.asarray([f.prior.fraction(f.nominal) for f in free])
    starts = [nominal, np.full(len(free), 0.5), np.full(len(free), 0.25)]
    plain = Scatter(np.ones(len(cells.channels)), 0.0, 0.0, 0.0, 1.0)
    none = np.zeros((len(cells), 2))
    bench = Bench(case, axes, cells, assembled(cells, none, plain), effects, calibration)
    soil = bench.soil_only(starts)
    if not np.isfinite(soil.prediction).all():
        bad = int(cells.row[np.flatnonzero(~np.isfinite(soil.prediction))[0]])
        return Analysis(
            bench, _nothing(soil), (), f"the model cannot carry the load of {place(bad)}"
        )
    best, dropped = soil, []
    found = _nothing(soil)
    for _ in range(PASSES):
        before = bench.covariance.scatter
        bench, lost = _scattered(bench, best, cells, found.left.signatures)
        dropped += [f"{name} at {place(row)}" for name, row in lost]
        if len(dropped) > MOST_OUTLIERS * (len(cells) + len(dropped)):
            text = f"{len(dropped)} readings stray from all others: look at the sensors first"
            return Analysis(bench, _nothing(soil), (), text)
        if found.causes and not lost and _alike(before, bench.covariance.scatter):
            break
        cells = bench.cells
        soil = bench.soil_only([soil.x])
        known = {c.names: coordinates(c.strict) for c in found.tried}
        found = search(bench, soil, seed, known)
        if not found.causes:
            break
        best = found.causes[0].fit
    return Analysis(bench, found, tuple(dropped))


def _alike(one: Scatter, other: Scatter) -> bool:
    """Whether two scatters would weigh the data alike."""
    return (
        bool(np.all(np.abs(one.scale / other.scale - 1.0) < 0.2))
        and one.memory == other.memory
        and abs(one.friction_angle - other.friction_angle) < 0.3 * SCATTER["friction_angle"]
        and abs(one.bearing - other.bearing) < 0.3 * SCATTER["bearing"]
    )


def _scattered(
    bench: Bench, fit: GapFit, cells: Cells, known: Sequence[Signature]
) -> tuple[Bench, list[tuple[str, int]]]:
    """The bench with noise and scatter as the misfits of a fit show them, strays left out."""
    case, reading = fit.fitted(), cells.reading
    if not known or len(known[0].column) != len(cells):
        known, _ = signatures(case, cells, bench.others(fit))
    raw = np.linalg.solve(bench.covariance.whiten, fit.slope)
    space = np.column_stack([raw, *[s.column for s in known], smooth_columns(cells)])
    residual = reading - fit.prediction
    typical = Scatter(np.ones(len(cells.channels)), np.deg2rad(0.5), 0.05, 0.0, 1.0)
    columns = scatter_columns(case, cells)
    wide = assembled(cells, columns if len(cells.runs) > 1 else 0.0 * columns, typical)
    explained = fit.prediction + _explained(wide, residual, space)
    cells = cells.expecting(explained)
    away = outliers(assembled(cells, columns, typical), residual, space)
    lost = [
        (column(cells.channels[cells.channel[i]]), int(cells.row[i])) for i in np.flatnonzero(away)
    ]
    kept = ~away
    cells = cells.keeping(kept)
    covariance = estimated(cells, columns[kept], residual[kept], space[kept])
    return replace(bench, cells=cells, covariance=covariance), lost


def _explained(covariance: Covariance, residual: Floats, space: Floats) -> Floats:
    """What the columns of a space explain of the residuals, by generalised least squares."""
    white = covariance.whiten @ space
    weights = np.linalg.lstsq(white, covariance.whiten @ residual, rcond=1e-6)[0]
    return np.asarray(space @ weights)


def _nothing(soil: GapFit) -> Found:
    from soilml.gap.search.stepwise import Left
    from soilml.gap.statistics.score_test import Scores

    blank = Scores(np.zeros(0), np.zeros(1), np.zeros(0), np.zeros(0))
    left = Left((), (), blank, 1.0)
    return Found(soil, left, (), (), left, {})
