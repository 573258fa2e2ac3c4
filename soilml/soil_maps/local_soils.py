"""The soil of short stretches of a drive, as Gaussian observations in normal scores."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats, Integers
from soilml.errors import FitError
from soilml.fitting.coordinates import Coordinate
from soilml.numerics.prior import Prior
from soilml.onboard.estimate import Estimate, Reason
from soilml.onboard.estimator import Estimator
from soilml.onboard.set_contract import COMMON_ERROR_INPUTS
from soilml.onboard.tracking import Event, SoilTracker
from soilml.soil_maps.drive import MapDrive
from soilml.traction.soil_draws import estimated_draws

ROWS, LEAST_ROWS = 8, 4  # Rows of one wheel in a stretch, and the fewest that are estimated
MOST_STRETCHES = 120  # Of all wheels; rows are more where a drive is longer
GAP = 2.0  # Distance within a stretch, in lengths of a stretch, from which on it ends
#: Rows of all wheels in a window from which the error is inferred that all stretches share.
WINDOW, LEAST_WINDOW = 64, 24
#: Gain of precision over the prior below which a direction counts as not observed.
LEAST_GAIN = 1e-3
END = 1e-9  # Least distance of a fraction from 0 and 1
LEAST_USED = 0.5  # Share of the rows that must be in the range of the file
UNREAD = (Event.UNUSABLE, Event.STUCK, Event.REPEATED)


@dataclass(frozen=True)
class FollowedRows:
    """What a tracker made of the rows (n,) of a drive."""

    used: NDArray[np.bool_]
    patch: Integers  # Number of changes of soil up to each row
    remembered: Integers  # Rows that it remembered after each
    unusable: int


@dataclass(frozen=True)
class LocalSoils:
    """Observations of the soil in b stretches of single wheels, in normal scores of p parameters.

    A normal score is the standard normal quantile of a value's cumulative probability in its prior.
    """

    free: tuple[Coordinate, ...]
    place: Floats  # (b, 2), m
    station: Floats  # (b,), m
    patch: Integers  # (b,)
    score: Floats  # (b, p)
    error: Floats  # Covariances (b, p, p), with sensors and model taken as exact
    common: Floats  # Covariance (p, p) of an error that all stretches share
    rows: tuple[Integers, ...]  # Of the drive, of each stretch

    def part(self, chosen: NDArray[np.bool_]) -> LocalSoils:
        """Some of the stretches (b,)."""
        names = ("place", "station", "patch", "score", "error")
        own = {name: getattr(self, name)[chosen] for name in names}
        rows = tuple(self.rows[i] for i in np.flatnonzero(chosen))
        return replace(self, **own, rows=rows)


def follow(
    estimator: Estimator, drive: MapDrive, progress: Callable[[int, int], None] | None = None
) -> FollowedRows:
    """The rows of a drive, in the order of their stations, as `SoilTracker` judges them.

    Raises `FitError` where most rows are out of the range of the file.
    """
    n, tracker = len(drive.station), SoilTracker(estimator)
    used, change = np.zeros(n, bool), np.zeros(n, bool)
    remembered, read = np.zeros(n, np.int64), []
    for i in range(n):
        state = tracker.read(**{name: float(values[i]) for name, values in drive.rows.items()})
        remembered[i] = state.rows_remembered
        if progress is not None:
            progress(i + 1, n)
        if state.event in UNREAD:
            continue
        read.append(i)
        used[i] = state.event is not Event.SET_ASIDE
        if state.event is Event.SOIL_CHANGED:  # the rows in question were of this soil
            first = read[-state.rows_since_change :]
            used[first], change[first[0]] = True, True
    if len(read) < LEAST_USED * n:
        raise FitError(
            f"{drive.source}: {n - len(read)} of {n} rows are outside the range of "
            f"{estimator.path}, stuck or repeated; check slip, torque_Nm and load_N"
        )
    return FollowedRows(used, np.cumsum(change), remembered, n - len(read))


def local_soils(
    estimator: Estimator,
    drive: MapDrive,
    followed: FollowedRows,
    progress: Callable[[int, int], None] | None = None,
) -> LocalSoils:
    r"""Estimates of each stretch, whose prior is divided out.

    .. math::
        N(z; m, S) \propto N(z; 0, I)\, N(y; z, R), \quad R^{-1} = S^{-1} - I, \quad
        y = R S^{-1} m

    Sensors and model are taken as exact in R. What their usual errors add to it in windows of many
    rows is the error that all stretches share. The posterior of a stretch is taken as normal in
    scores.

    Raises `FitError` where no stretch has an estimate.

    References: Tresp, Neural Computation 12(11), 2000, eq. 8 (estimates of parts, whose common
    prior counts once).
    """
    free, exact = coordinates(estimator), with_exact_sensors(estimator)
    parts = list(_stretches(drive, followed))
    windows = list(_windows(followed))
    done, total = 0, len(parts) + len(windows)
    found: list[tuple[Any, ...]] = []
    shared: list[Floats] = []
    for part in (*parts, *windows):
        rows = drive.of_rows(part)
        estimate = exact.run(**rows)
        done += 1
        if progress is not None:
            progress(done, total)
        if estimate.reason not in (Reason.ESTIMATED, Reason.INCONSISTENT):
            continue
        score, error = observation(*moments(estimate, free))
        if done <= len(parts):
            middle = drive.place[part].mean(axis=0), float(drive.station[part].mean())
            found.append((*middle, followed.patch[part[0]], score, error, part))
            continue
        averaged = estimator.run(**rows)
        if averaged.reason == Reason.ESTIMATED and estimate.reason == Reason.ESTIMATED:
            whole = observation(*moments(averaged, free))[1]
            shared.append(_excess(whole, error))
    if not found:
        raise FitError(f"{drive.source}: no stretch of {LEAST_ROWS} rows or more has an estimate")
    arrays = [np.asarray(each) for each in list(zip(*found, strict=True))[:-1]]
    parts = [one[-1] for one in found]
    place, station, patch, score, error = arrays
    common = _typical(shared, len(free))
    return LocalSoils(tuple(free), place, station, patch, score, error, common, tuple(parts))


def coordinates(estimator: Estimator) -> list[Coordinate]:
    """The quantities of a file with its priors."""
    prior = estimator.prior
    names = zip(estimator.names, estimator.units, prior.lower, prior.upper, strict=True)
    return [Coordinate(n, u, Prior(float(low), float(high))) for n, u, low, high in names]


def moments(estimate: Estimate, free: list[Coordinate]) -> tuple[Floats, Floats]:
    """Mean (p,) and covariance (p, p) of the normal scores of an estimate."""
    from scipy.special import ndtri

    draws = estimated_draws(free, estimate.mean, estimate.covariance).values
    low = np.asarray([f.prior.lower for f in free])
    width = np.asarray([f.prior.upper for f in free]) - low
    score = ndtri(np.clip((draws - low) / width, END, 1.0 - END))
    return score.mean(axis=0), np.cov(score.T)


def soil_values(free: tuple[Coordinate, ...], score: Floats) -> Floats:
    """Values (..., p) in SI units of normal scores (..., p)."""
    from scipy.special import ndtr

    return np.stack([f.value(ndtr(score[..., i])) for i, f in enumerate(free)], axis=-1)


def observation(mean: Floats, covariance: Floats) -> tuple[Floats, Floats]:
    """Observation (p,) and its error (p, p), from a posterior whose prior is standard normal."""
    size, axes = np.linalg.eigh(covariance)
    gain = 1.0 / size - 1.0
    known = gain > LEAST_GAIN
    gain = np.where(known, gain, LEAST_GAIN)
    along = np.where(known, (axes.T @ mean) / size / gain, 0.0)
    return axes @ along, (axes / gain) @ axes.T


def with_exact_sensors(estimator: Estimator) -> Estimator:
    """The estimator with sensors and model taken as exact, but for their noise."""
    known = estimator.sets.common_errors if estimator.sets else {}
    none: dict[str, Any] = {name: 0.0 for name in COMMON_ERROR_INPUTS if name in known}
    return estimator.on(**none)


def _stretches(drive: MapDrive, followed: FollowedRows) -> list[Integers]:
    """Rows of one wheel and patch that follow each other."""
    count = max(ROWS, int(np.ceil(followed.used.sum() / MOST_STRETCHES)))
    found = []
    for patch in np.unique(followed.patch):
        for wheel in np.unique(drive.wheel):
            own = np.flatnonzero(followed.used & (followed.patch == patch) & (drive.wheel == wheel))
            step = np.diff(drive.station[own])
            usual = float(np.median(step)) if step.size else 0.0
            ends = np.flatnonzero(step > GAP * count * usual) + 1
            for run in np.split(own, ends):
                pieces = np.array_split(run, max(1, round(len(run) / count)))
                found += [piece for piece in pieces if len(piece) >= LEAST_ROWS]
    return found


def _windows(followed: FollowedRows) -> list[Integers]:
    """Rows of all wheels on one patch that follow each other."""
    found = []
    for patch in np.unique(followed.patch):
        own = np.flatnonzero(followed.used & (followed.patch == patch))
        pieces = np.array_split(own, max(1, round(len(own) / WINDOW)))
        found += [piece for piece in pieces if len(piece) >= LEAST_WINDOW]
    return found


def _excess(whole: Floats, own: Floats) -> Floats:
    """The part (p, p) of a covariance beyond another, zero where it is smaller."""
    root = np.linalg.cholesky(whole)
    white = np.linalg.solve(root, np.linalg.solve(root, own).T)
    share, axes = np.linalg.eigh(0.5 * (white + white.T))
    rotated = root @ axes
    return np.asarray((rotated * np.clip(1.0 - share, 0.0, 1.0)) @ rotated.T)


def _typical(errors: list[Floats], p: int) -> Floats:
    """The error of median size, by what it would leave of the prior; none without any."""
    if not errors:
        return np.zeros((p, p))
    left = [np.trace(np.linalg.solve(np.eye(p) + error, error)) for error in errors]
    return errors[int(np.argsort(left)[len(left) // 2])]
