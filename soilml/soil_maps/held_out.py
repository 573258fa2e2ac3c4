"""How well a map predicts the torque on stretches that it has not seen, beside simpler answers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.onboard.estimator import Estimator
from soilml.onboard.set_contract import LEAST_STD
from soilml.physics.operating_point import MOST_SLIP, Operating
from soilml.soil_maps.field import SoilField
from soilml.soil_maps.local_soils import FollowedRows, LocalSoils, MapDrive, moments, soil_values
from soilml.traction.draws import SoilDraws

PIECES, HELD = 24, 4  # Pieces of equal length of the path, of which every fourth is held out
LEAST_STRETCHES = 24  # Stretches from which on there is a score
DRAWS = 64  # Of the soil, for each row
OUTLIER, OUTLIER_STD = 0.01, 0.3  # Share of glitches, and their error over torque
METHODS = ("map", "tracker", "one soil")


@dataclass(frozen=True)
class HeldOutScore:
    """Mean log density of the torque (N m) of a row, by method, on h pieces of the path."""

    pieces: Mapping[str, Floats]  # (h,) by method
    rows: int

    @property
    def mean(self) -> dict[str, float]:
        """Over the pieces."""
        return {name: float(values.mean()) for name, values in self.pieces.items()}

    def gain(self, name: str) -> tuple[float, float]:
        """How much better the map is than another method, and the standard error of that."""
        apart = self.pieces["map"] - self.pieces[name]
        return float(apart.mean()), float(apart.std(ddof=1) / np.sqrt(len(apart)))


def held_out_score(
    case: Case,
    exact: Estimator,
    drive: MapDrive,
    followed: FollowedRows,
    soils: LocalSoils,
) -> HeldOutScore | None:
    """The score of every fourth piece of the path, by a field without the stretches in it.

    The tracker's answer is that of the rows that it remembers where a piece begins; one soil is
    that of all rows in no such piece. All three answer for the soil as the sensors show it, so that
    errors which all rows share do not matter. None for fewer stretches than `LEAST_STRETCHES`.

    exact: The estimator with sensors and model taken as exact.
    """
    if len(soils.station) < LEAST_STRETCHES:
        return None
    low, high = soils.station.min(), soils.station.max()
    piece = np.minimum((soils.station - low) / (high - low) * PIECES, PIECES - 1).astype(np.int64)
    held = piece % HELD == HELD // 2
    field = SoilField(soils.part(~held))
    free = list(soils.free)
    kept_rows = np.concatenate([soils.rows[i] for i in np.flatnonzero(~held)])
    whole = moments(exact.run(**drive.of_rows(np.sort(kept_rows))), free)
    found: dict[str, list[float]] = {name: [] for name in METHODS}
    count = 0
    for number in np.unique(piece[held]):
        rows = np.sort(np.concatenate([soils.rows[i] for i in np.flatnonzero(piece == number)]))
        count += len(rows)
        before = np.flatnonzero(followed.used[: rows[0]])
        window = before[-max(int(followed.remembered[rows[0] - 1]), 1) :]
        answers = [field.at(drive.place[rows], as_read=True)]
        past = exact.run(**drive.of_rows(window)) if len(window) else None
        for one in (moments(past, free) if past is not None else _prior(len(free)), whole):
            mean, covariance = (np.broadcast_to(a, (len(rows), *a.shape)) for a in one)
            answers.append((mean, covariance))
        own = drive.part(rows)
        for name, answer in zip(METHODS, answers, strict=True):
            rng = np.random.default_rng(int(number))  # the same draws for all methods
            found[name].append(float(torque_score(case, exact, own, soils, answer, rng).mean()))
    return HeldOutScore({name: np.asarray(values) for name, values in found.items()}, count)


def _prior(p: int) -> tuple[Floats, Floats]:
    return np.zeros(p), np.eye(p)


def torque_score(
    case: Case,
    exact: Estimator,
    drive: MapDrive,
    soils: LocalSoils,
    answer: tuple[Floats, Floats],
    rng: np.random.Generator,
) -> Floats:
    """Log density (n,) of the torque of the rows of a drive, given slip and load.

    answer: Means (n, p) and covariances (n, p, p) of the normal scores of the soil.
    rng: Draws soil, and noise of slip and load as the estimator has it.
    """
    mean, covariance = answer
    p, given = mean.shape[1], exact.sets.noise if exact.sets is not None else {}
    noise = rng.standard_normal((len(mean), DRAWS, p + 2))
    root = np.linalg.cholesky(covariance)
    score = mean[:, None] + np.einsum("nij,nkj->nki", root, noise[..., :p])
    slip, load = (
        (value + _std(given, name, value) * own.T).T
        for name, value, own in (
            ("slip", drive.rows["slip"], noise[..., p]),
            ("load", drive.rows["load"], noise[..., p + 1]),
        )
    )
    values = soil_values(soils.free, score).reshape(-1, p)
    draws = SoilDraws(tuple(f.path for f in soils.free), values)
    at = Operating(
        slip=np.clip(slip, -MOST_SLIP, MOST_SLIP).ravel(), load=np.maximum(load, 1e-3).ravel()
    )
    torque = np.asarray(draws.forces(case, np.arange(len(values)), at).torque).reshape(slip.shape)
    read = drive.rows["torque"][:, None]
    std = _std(given, "torque", torque)
    wide = np.hypot(std, OUTLIER_STD * np.abs(read))
    logs = [
        np.log(share / s) - 0.5 * ((read - torque) / s) ** 2
        for share, s in ((1.0 - OUTLIER, std), (OUTLIER, wide))
    ]
    each = np.where(np.isfinite(torque), np.logaddexp(*logs), -np.inf)
    constant = 0.5 * np.log(2.0 * np.pi) + np.log(DRAWS)
    return np.asarray(np.logaddexp.reduce(each, axis=1) - constant)


def _std(noise: Mapping[str, tuple[float, float]], name: str, value: Floats) -> Floats:
    """Standard deviation of readings of this size, above zero."""
    constant, share = noise.get(name, (0.0, 0.0))
    return np.asarray(np.maximum(np.hypot(constant, share * value), LEAST_STD))
