"""How much of a gap an explanation closes: where it was fitted, and where it was not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from soilml.errors import InputError
from soilml.gap.data.observations import Cells, distinct
from soilml.gap.results import Shrink
from soilml.gap.search.candidate_fits import Bench
from soilml.gap.statistics.coordinates import predicted
from soilml.gap.statistics.least_squares import GapFit, descend
from soilml.gap.statistics.reml_covariance import Covariance, assembled, scatter_columns
from soilml.quantities import column

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

FOLDS = 4
#: Share of the cells, the heaviest or those of highest slip, that make the held-out region.
REGION = 0.3


def shrink(cells: Cells, std: Floats, before: Floats, after: Floats, what: str) -> Shrink:
    """Mean squares of what two predictions leave of the cells, in their standard deviations.

    A prediction without equilibrium counts as if it were ten standard deviations off.
    """

    def squares(y: Floats) -> Floats:
        return np.nan_to_num(((cells.reading - y) / std) ** 2, nan=100.0)

    old, new = squares(before), squares(after)
    channels = {
        column(name): (float(old[cells.channel == i].mean()), float(new[cells.channel == i].mean()))
        for i, name in enumerate(cells.channels)
        if (cells.channel == i).any()
    }
    return Shrink(float(old.mean()), float(new.mean()), channels, len(cells), what)


def refitted(bench: Bench, fit: GapFit, kept: Mask) -> GapFit:
    """The same model fitted again to some of the cells, from where it stood."""
    matrix = bench.covariance.matrix[np.ix_(kept, kept)]
    whiten = np.linalg.inv(np.linalg.cholesky(matrix))
    return descend(fit.case, fit.axes, bench.cells.keeping(kept), whiten, fit.x)


def held_out_runs(bench: Bench, soil: GapFit, after: GapFit, seed: int) -> Shrink | None:
    """Each run predicted by fits to the others; None where there are fewer than three runs."""
    runs = len(bench.cells.runs)
    if runs < 3:
        return None
    fold = np.random.default_rng(seed).permutation(runs) % min(FOLDS, runs)
    of_cell = fold[bench.cells.run[bench.cells.row]]
    return _crossed(bench, soil, after, of_cell, "every run predicted by fits to the others")


def held_out_region(bench: Bench, soil: GapFit, after: GapFit) -> Shrink | None:
    """The heaviest loads predicted from the lighter; high slips where one load was driven."""
    cells = bench.cells
    by_load = distinct(np.log(cells.load)) >= 3
    values = cells.load if by_load else cells.slip
    if distinct(values) < 3:
        return None
    levels = np.unique(values)
    shares = np.asarray([np.mean(values >= level) for level in levels])
    edge = levels[int(np.argmin(np.abs(shares - REGION)))]
    beyond = values >= edge
    name = f"load_N >= {edge:.4g}" if by_load else f"slip >= {edge:.3g}"
    return _crossed(
        bench, soil, after, np.where(beyond, 1, 0), f"{name}, predicted from the rest", 1
    )


def _crossed(
    bench: Bench,
    soil: GapFit,
    after: GapFit,
    fold: NDArray[np.int64],
    what: str,
    only: int | None = None,
) -> Shrink | None:
    old, new = np.full(len(bench.cells), np.nan), np.full(len(bench.cells), np.nan)
    folds = np.unique(fold) if only is None else [only]
    for number in folds:
        out = fold == number
        for fit, target in ((soil, old), (after, new)):
            try:
                again = refitted(bench, fit, ~out)
            except (InputError, np.linalg.LinAlgError):
                continue  # no fit, no prediction: these cells count as far off
            y = predicted(again.case, again.axes, again.x[None, :], bench.cells)[0]
            target[out] = y[out]
    held = np.isin(fold, folds)
    cells = bench.cells.keeping(held)
    return shrink(cells, bench.covariance.std[held], old[held], new[held], what)


def unseen(bench: Bench, soil: GapFit, after: GapFit, cells: Cells, what: str) -> Shrink:
    """Rows that took no part in anything, predicted by both fits."""
    old = predicted(soil.case, soil.axes, soil.x[None, :], cells)[0]
    new = predicted(after.case, after.axes, after.x[None, :], cells)[0]
    return shrink(cells, spread(bench, after, cells).std, old, new, what)


def spread(bench: Bench, fit: GapFit, cells: Cells) -> Covariance:
    """The covariance of other cells, by the scatter found on the bench."""
    own = bench.covariance.scatter
    place = {name: i for i, name in enumerate(bench.cells.channels)}
    scale = np.asarray([own.scale[place[n]] if n in place else 1.0 for n in cells.channels])
    columns = scatter_columns(fit.fitted(), cells)
    return assembled(cells, columns, replace(own, scale=scale))
