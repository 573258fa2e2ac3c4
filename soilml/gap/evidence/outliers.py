"""Outliers: readings inconsistent with all other readings together."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats, Integers
from soilml.fitting.readings import Readings
from soilml.gap.evidence.covariance import Covariance, fixed_effects
from soilml.quantities import Z_50, column
from soilml.remarks import Remark

#: Studentised residual above which a reading is an outlier: chance exceeds it once in 150 000
#: readings.
OUTLIER_SIGMA = 4.5
#: Studentised residual over the largest one, from which both can be outliers at a time.
LEADING_SHARE = 0.5
#: Fraction of outliers above which they form a pattern, so that the data cannot be analysed.
MAX_OUTLIER_FRACTION = 0.1
#: Readings whose residual variance is below this fraction of their own are determined by the fit;
#: their studentised residual is undefined.
MIN_RESIDUAL_VARIANCE = 1e-3
#: Studentised residual above which a repeat strays too, and the difference of two repeats, in its
#: standard deviations, up to which they agree: each is exceeded by chance once in 370 readings.
REPEAT_SIGMA = 3.0


def outliers(
    covariance: Covariance,
    residual: Floats,
    space: Floats,
    replicate_group: Integers | None = None,
    run: Integers | None = None,
    smooth: Floats | None = None,
) -> NDArray[np.bool_]:
    r"""Readings (m,) whose studentised residual is large, and which no repeat confirms.

    .. math:: t_i = (P r)_i / \sqrt{P_{ii}}, \quad
        P = V^{-1} - V^{-1} X (X^T V^{-1} X)^{-1} X^T V^{-1}

    compared with a robust scale, the median of \|t\|, where that exceeds 1. Of those that exceed
    it, the farthest and those at least half as far are outliers: a fit that one of them has moved
    leaves others large too.

    residual : array (m,)
    space (m, q): X, all that soil, effects and smooth functions could explain.
    replicate_group (m,): Group of each reading: readings of one group are repeats
        of each other, of one channel. A reading whose repeat strays to the same side and agrees
        with it is a strange but repeatable response and no outlier.
    run (m,): Run of each reading. Where a group has several runs, only another
        run confirms a reading: neighbouring samples of one run may share a fault.
    smooth (m, k): Smooth functions beside X, of channels with few readings.
    References: Cook and Weisberg, Residuals and Influence in Regression, 1982.
    """
    whiten = covariance.whiten
    basis = fixed_effects(whiten @ space, None if smooth is None else whiten @ smooth)
    white, explained = whiten @ residual, whiten.T @ basis
    projected = whiten.T @ (white - basis @ (basis.T @ white))  # P r
    diagonal = (whiten**2).sum(axis=0) - (explained**2).sum(axis=1)  # of P
    defined = diagonal > MIN_RESIDUAL_VARIANCE / covariance.std**2
    t = np.where(defined, projected / np.sqrt(np.where(defined, diagonal, 1.0)), 0.0)
    scale = 1.0
    if defined.any():
        scale = max(1.0, float(np.median(np.abs(t[defined]))) / Z_50)
    strays = np.abs(t) > max(OUTLIER_SIGMA * scale, LEADING_SHARE * float(np.abs(t).max()))
    if replicate_group is None:
        return np.asarray(strays)
    run = np.zeros(len(residual), dtype=np.int64) if run is None else run
    confirmed = [
        bool(strays[i])
        and _is_confirmed(int(i), covariance, residual, t / scale, replicate_group, run)
        for i in range(len(residual))
    ]
    return np.asarray(strays & ~np.asarray(confirmed))


def _is_confirmed(
    i: int,
    covariance: Covariance,
    residual: Floats,
    t: Floats,
    replicate_group: Integers,
    run: Integers,
) -> bool:
    """Whether a repeat of reading `i` strays to the same side, and agrees with it."""
    repeats = np.flatnonzero(replicate_group == replicate_group[i])
    repeats = repeats[repeats != i]
    of_other_runs = repeats[run[repeats] != run[i]]
    repeats = of_other_runs if of_other_runs.size else repeats
    matrix = covariance.matrix
    variance = matrix[i, i] + np.diag(matrix)[repeats] - 2.0 * matrix[i, repeats]
    agree = np.abs(residual[repeats] - residual[i]) <= REPEAT_SIGMA * np.sqrt(variance)
    return bool(np.any(agree & (t[repeats] * np.sign(t[i]) > REPEAT_SIGMA)))


#: Readings of a series, in one channel of one run, from which its ends can be judged.
LEAST_SERIES = 4
SAME_LOAD = 0.15  # Range of the load of such a series, as a fraction of the smallest


def ends_of_monotone_series(readings: Readings) -> NDArray[np.bool_]:
    """The readings (m,) at the highest slip of a run whose channel changes in one direction.

    Such a reading is large because the series is, and a model that does not follow it is no reason
    to exclude it: it tells most of what the model lacks. Changes within the noise are of either
    direction.
    """
    found = np.zeros(len(readings), dtype=np.bool_)
    run = readings.run[readings.row]
    for channel in range(len(readings.channels)):
        for number in np.unique(run):
            own = np.flatnonzero((run == number) & (readings.channel == channel))
            if (
                own.size < LEAST_SERIES
                or np.ptp(readings.load[own]) > SAME_LOAD * readings.load[own].min()
            ):
                continue
            own = own[np.argsort(readings.slip[own], kind="stable")]
            change = np.diff(readings.measured[own])
            noise = np.hypot(readings.std[own][1:], readings.std[own][:-1])
            for sign in (1.0, -1.0):
                if (sign * change > -noise).all() and sign * change[-1] > 0.0:
                    found[own[-1]] = True
    return found


#: Outliers that the reason for bad data states; its remark names all of them.
OUTLIERS_STATED = 3


def names_of(
    readings: Readings, selected: NDArray[np.bool_], place: Callable[[int], str]
) -> tuple[str, ...]:
    """The selected readings (m,) by channel and place."""
    return tuple(
        f"{column(readings.channels[readings.channel[i]])} at {place(int(readings.row[i]))}"
        for i in np.flatnonzero(selected)
    )


def many_outliers(names: Sequence[str]) -> Remark:
    """Why the readings of these names forbid an analysis; the text has the first of them."""
    more = len(names) - OUTLIERS_STATED
    text = f"{len(names)} readings are outliers: check the sensors first: "
    text += ", ".join(names[:OUTLIERS_STATED]) + (f" and {more} more" if more > 0 else "")
    return Remark("many-outliers", text, tuple(names))
