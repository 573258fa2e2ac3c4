"""Places and stations of a drive, and estimates of the soil in stretches between changes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats, Integers
from soilml.config.case import Case
from soilml.errors import FitError, TableError
from soilml.fitting.coordinates import Coordinate
from soilml.fitting.operating_points import with_rover_columns
from soilml.io.read_table import Rows, as_table, check_table
from soilml.io.table import Table
from soilml.numerics.importance_sampling import importance_sample
from soilml.numerics.maximum_entropy import moment_matched_weights
from soilml.numerics.prior import Prior
from soilml.onboard.estimate import Estimate, Reason
from soilml.onboard.estimator import Estimator
from soilml.onboard.set_contract import COMMON_ERROR_INPUTS
from soilml.onboard.tracking import Event, SoilTracker
from soilml.quantities import CHANNELS, column

ROWS, LEAST_ROWS = 8, 4  # Rows of one wheel in a stretch, and the fewest that are estimated
MOST_STRETCHES = 120  # Of all wheels; rows are more where a drive is longer
GAP = 2.0  # Distance within a stretch, in lengths of a stretch, from which on it ends
#: Rows of all wheels in a window from which the error is inferred that all stretches share.
WINDOW, LEAST_WINDOW = 64, 24
#: Gain of precision over the prior below which a direction counts as not observed.
LEAST_GAIN = 1e-3
LEAST_VARIANCE = 1e-10  # Of fractions and scores: sums of draws may round to none
END = 1e-9  # Least distance of a fraction from 0 and 1
LEAST_USED = 0.5  # Share of the rows that must be in the range of the file
UNREAD = (Event.UNUSABLE, Event.STUCK, Event.REPEATED)


@dataclass(frozen=True)
class FollowedRows:
    """What a tracker made of the rows (n,) of a drive."""

    used: NDArray[np.bool_]
    patch: Integers  # Number of changes of soil up to each row
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


def follow(
    estimator: Estimator, drive: MapDrive, progress: Callable[[int, int], None] | None = None
) -> FollowedRows:
    """The rows of a drive, in the order of their stations, as `SoilTracker` judges them.

    Raises `FitError` where most rows are out of the range of the file.
    """
    n, tracker = len(drive.station), SoilTracker(estimator)
    used, change = np.zeros(n, bool), np.zeros(n, bool)
    read = []
    for i in range(n):
        state = tracker.read(**{name: float(values[i]) for name, values in drive.rows.items()})
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
    return FollowedRows(used, np.cumsum(change), n - len(read))


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
            found.append((*middle, followed.patch[part[0]], score, error))
            continue
        averaged = estimator.run(**rows)
        if averaged.reason == Reason.ESTIMATED and estimate.reason == Reason.ESTIMATED:
            whole = observation(*moments(averaged, free))[1]
            shared.append(_excess(whole, error))
    if not found:
        raise FitError(f"{drive.source}: no stretch of {LEAST_ROWS} rows or more has an estimate")
    place, station, patch, score, error = map(np.asarray, zip(*found, strict=True))
    common = _typical(shared, len(free))
    return LocalSoils(tuple(free), place, station, patch, score, error, common)


def coordinates(estimator: Estimator) -> list[Coordinate]:
    """The quantities of a file with its priors."""
    prior = estimator.prior
    names = zip(estimator.names, estimator.units, prior.lower, prior.upper, strict=True)
    return [Coordinate(n, u, Prior(float(low), float(high))) for n, u, low, high in names]


def moments(estimate: Estimate, free: Sequence[Coordinate]) -> tuple[Floats, Floats]:
    r"""Mean (p,) and covariance (p, p) of the normal scores of an estimate.

    Those of the maximum-entropy density in the prior with the moments of the estimate,

    .. math:: p(u) \propto \exp(\lambda^\top u + u^\top \Lambda u), \quad u \in [0, 1]^p

    which is a Gaussian where the estimate is narrow, and the prior where it is as wide.

    References: Jaynes, Phys. Rev. 106, 1957.
    """
    from scipy.special import ndtri

    low = np.asarray([f.prior.lower for f in free])
    width = np.asarray([f.prior.upper for f in free]) - low
    middle = (estimate.mean - low) / width
    factor = lower_root(estimate.covariance / np.outer(width, width))

    def white(u: Floats) -> Floats:
        return np.asarray(np.linalg.solve(factor, (u - middle).T).T)

    found = importance_sample(lambda u: -0.5 * (white(u) ** 2).sum(axis=1), len(free))
    weights = moment_matched_weights(found.weights, white(found.u))
    score = ndtri(np.clip(found.u, END, 1.0 - END))
    mean = weights @ score
    return mean, ((score - mean).T * weights) @ (score - mean)


def lower_root(covariance: Floats) -> Floats:
    """Cholesky factors of covariances (..., p, p), of at least `LEAST_VARIANCE` along any axis."""
    size, axes = np.linalg.eigh(covariance)
    if size.min() < LEAST_VARIANCE:
        raised = axes * np.maximum(size, LEAST_VARIANCE)[..., None, :]
        covariance = raised @ np.swapaxes(axes, -1, -2)
    return np.asarray(np.linalg.cholesky(covariance), dtype=np.float64)


def soil_values(free: tuple[Coordinate, ...], score: Floats) -> Floats:
    """Values (..., p) in SI units of normal scores (..., p)."""
    from scipy.special import ndtr

    return np.stack([f.value(ndtr(score[..., i])) for i, f in enumerate(free)], axis=-1)


def observation(mean: Floats, covariance: Floats) -> tuple[Floats, Floats]:
    """Observation (p,) and its error (p, p), from a posterior whose prior is standard normal."""
    size, axes = np.linalg.eigh(covariance)
    size = np.maximum(size, LEAST_VARIANCE)
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
    root = lower_root(whole)
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


NEEDED = ("x_m", "y_m", "slip", "torque_Nm", "load_N")
LEAST_OF_DRIVE = 24  # Rows of a drive
#: A step of the path that is so many times the usual one, and at least so long (m), is a jump.
JUMP, LEAST_JUMP = 30.0, 1.0


@dataclass(frozen=True)
class MapDrive:
    """Rows (n,) of a drive in the order of their stations."""

    rows: dict[str, Floats]  # Inputs of an estimator by name, SI units
    place: Floats  # Of the wheel's contact, (n, 2), m
    station: Floats  # Along the path, m
    wheel: Integers  # Number of the wheel of each row
    row: Integers  # Position of each in the table, without the rows that lack a reading
    source: str

    def of_rows(self, rows: Any) -> dict[str, Floats]:
        """Inputs of an estimator of some rows."""
        return {name: values[rows] for name, values in self.rows.items()}


def read_map_drive(table: Rows, case: Case) -> MapDrive:
    """The rows of a table with x_m, y_m, slip, torque_Nm and load_N, where all are known.

    Positions are those of the wheel's contact; where the table has heading_rad and wheel, those of
    the rover's origin, from which the contact follows by [rover.wheels]. With several wheels,
    time_s says which rows belong together.

    Raises `TableError` for a missing column or position, an unknown wheel and a position that
    jumps, and `FitError` for too few rows.
    """
    table = as_table(table)
    posed = case.rover is not None and "wheel" in table and "heading_rad" in table
    filled = (*NEEDED[:2], *(("heading_rad",) if posed else ()))
    table = check_table(table, Path(table.source), NEEDED, filled, None)
    table = table.rows(table.answered & np.isfinite([table[name] for name in NEEDED]).all(axis=0))
    if len(table) < LEAST_OF_DRIVE:
        raise FitError(
            f"{table.source}: {len(table)} rows with position, slip, torque and load; a map needs "
            f"{LEAST_OF_DRIVE} or more"
        )
    place: Floats = np.column_stack([table["x_m"], table["y_m"]])
    if posed:
        place = place + _contacts(with_rover_columns(case, table), case)
    wheels, wheel = np.unique(
        table["wheel"] if "wheel" in table else np.zeros(len(table)), return_inverse=True
    )
    if len(wheels) > 1 and "time_s" not in table:
        raise TableError(
            f"{table.source}: column time_s is missing; it says which rows of the "
            f"{len(wheels)} wheels belong together"
        )
    time: Floats = table["time_s"] if len(wheels) > 1 else np.arange(float(len(table)))
    station = _stations(table, time, place)
    order = np.argsort(station, kind="stable")
    rows = {"slip": table["slip"], "load": table["load_N"]}
    rows |= {name: table[column(name)] for name in CHANNELS if column(name) in table}
    rows = {name: np.asarray(values, dtype=np.float64)[order] for name, values in rows.items()}
    return MapDrive(rows, place[order], station[order], wheel[order], order, table.source)


def _contacts(table: Table, case: Case) -> Floats:
    """Places (n, 2) of the contacts from the rover's origin, m."""
    assert case.rover is not None
    known, heading = case.rover.wheels, table["heading_rad"]
    cos, sin = np.cos(heading), np.sin(heading)
    ahead, left = np.asarray([(known[n].forward, known[n].left) for n in table["wheel"]]).T
    return np.column_stack([ahead * cos - left * sin, ahead * sin + left * cos])


def _stations(table: Table, time: Floats, place: Floats) -> Floats:
    """Length of the path up to each row, m: of the mean place at its time, and the way ahead of it.

    Raises `TableError` where a step of the path is out of proportion.
    """
    _times, which, count = np.unique(time, return_inverse=True, return_counts=True)
    middle = np.column_stack([np.bincount(which, place[:, k]) / count for k in range(2)])
    step = np.hypot(*np.diff(middle, axis=0).T)
    moved = step[step > 0.0]
    limit = max(JUMP * float(np.median(moved)), LEAST_JUMP) if moved.size else np.inf
    if (step > limit).any():
        number = int(np.argmax(step > limit))
        row = int(np.flatnonzero(which == number + 1)[0])
        raise TableError(
            f"{table.place(row)}: the position jumps by {step[number]:.3g} m, the usual step is "
            f"{np.median(moved):.2g} m; mend x_m and y_m, or map the parts one by one"
        )
    if not moved.size:
        raise TableError(f"{table.source}: x_m and y_m are the same in all rows: there is no path")
    length = np.concatenate([[0.0], np.cumsum(step)])
    along = np.gradient(middle, axis=0)
    along /= np.maximum(np.hypot(*along.T), 1e-12)[:, None]
    return np.asarray(length[which] + ((place - middle[which]) * along[which]).sum(axis=1))
