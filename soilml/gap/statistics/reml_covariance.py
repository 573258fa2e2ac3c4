"""How readings scatter: noise, soil that differs from run to run, samples that remember."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.gap.data.observations import Cells
from soilml.gap.statistics.coordinates import Axis, linearised
from soilml.numerics.prior import Prior
from soilml.parameters import declared
from soilml.physics.soils import Soil

Floats = NDArray[np.float64]

#: One unit of run-to-run scatter: half a degree of friction angle, 5 % of the bearing moduli.
SCATTER = {"friction_angle": np.deg2rad(0.5), "bearing": 0.05}
#: Spread of the prior of scatter, in those units, and of the log of the noise's scale.
USUAL_SCATTER, USUAL_SCALE = 1.0, 0.3
#: With fewer runs than this scatter cannot be measured; this much of it is taken for granted then.
FEW_RUNS, GRANTED = 6, 0.8
#: Correlations of neighbouring samples, and scales of scatter, that are tried.
MEMORY = (0.25, 0.5, 0.7, 0.85, 0.95)
TIMES = (0.0, 0.25, 0.5, 0.8, 1.2, 1.8, 3.0, 5.0)


@dataclass(frozen=True)
class Scatter:
    """What was found of the scatter: scale of each channel's noise, run-to-run soil, memory."""

    scale: Floats  # (channels,) of the declared noise
    friction_angle: float  # rad, from run to run
    bearing: float  # share, from run to run
    memory: float  # correlation of neighbouring samples of a run
    freedom: float  # degrees of freedom that the noise was estimated from


@dataclass(frozen=True)
class Covariance:
    """The covariance of all cells, (m, m), and the inverse of its Cholesky factor."""

    matrix: Floats
    whiten: Floats
    scatter: Scatter

    @property
    def std(self) -> Floats:
        """Standard deviation of each cell, (m,)."""
        return np.asarray(np.sqrt(np.diag(self.matrix)))


def scatter_columns(case: Case, cells: Cells) -> Floats:
    """Change of each cell, (m, 2), by one unit of scatter of friction angle and of bearing."""
    angle = declared(Soil)["friction_angle"]
    phi = float(case.soil.friction_angle)
    axis = Axis(
        "friction_angle",
        "rad",
        (angle.lower - phi) / SCATTER["friction_angle"],
        (angle.upper - phi) / SCATTER["friction_angle"],
        Prior(phi, phi + SCATTER["friction_angle"]),
    )
    by_angle = linearised(case, [axis], np.zeros(1), cells)[1][:, 0]
    sides = []
    for sign in (1.0, -1.0):
        stiffer = {k: float(getattr(case.soil, k)) * (1.0 + sign * 1e-4) for k in ("kc", "kphi")}
        sides.append(linearised(case.with_values(stiffer), [], np.zeros(0), cells)[0])
    by_bearing = (sides[0] - sides[1]) / 2e-4 * SCATTER["bearing"]
    return np.asarray(np.nan_to_num(np.stack([by_angle, by_bearing], axis=1)))


def assembled(cells: Cells, columns: Floats, scatter: Scatter) -> Covariance:
    """The covariance that a scatter makes of the cells' declared noise."""
    std = cells.std * scatter.scale[cells.channel]
    matrix = np.outer(std, std) * _remembering(cells, scatter.memory)
    sizes = np.asarray(
        [
            scatter.friction_angle / SCATTER["friction_angle"],
            scatter.bearing / SCATTER["bearing"],
        ]
    )
    matrix += _same_run(cells) * ((columns * sizes**2) @ columns.T)
    return Covariance(matrix, np.linalg.inv(np.linalg.cholesky(matrix)), scatter)


def _memory_seen(cells: Cells, residual: Floats, basis: Floats) -> bool:
    """Whether neighbouring samples of a run are more alike than chance lets them be."""
    white, q = residual / cells.std, np.linalg.qr(basis / cells.std[:, None])[0]
    left = white - q @ (q.T @ white)
    run = cells.run[cells.row]
    place = cells.order[cells.row]
    key = np.lexsort((place, cells.channel, run))
    follows = (np.diff(run[key]) == 0) & (np.diff(cells.channel[key]) == 0)
    follows &= np.diff(place[key]) == 1
    pairs = left[key][:-1][follows] * left[key][1:][follows]
    if pairs.size < 8:
        return False
    # what fitting takes out of the residuals makes neighbours unlike: allow for it
    expected = -float(np.sum((q @ q.T)[key[:-1][follows], key[1:][follows]]))
    spread = float(np.mean(left**2)) * np.sqrt(pairs.size)
    return bool(pairs.sum() - expected * float(np.mean(left**2)) > 2.0 * spread)


def _same_run(cells: Cells) -> Floats:
    run = cells.run[cells.row]
    return np.asarray(run[:, None] == run, dtype=np.float64)


def _remembering(cells: Cells, memory: float) -> Floats:
    """Correlation of the noise of cells: neighbours of one channel in one run share it."""
    if memory == 0.0:
        return np.eye(len(cells))
    alike = _same_run(cells) * (cells.channel[:, None] == cells.channel)
    place = cells.order[cells.row].astype(np.float64)
    apart = np.abs(place[:, None] - place)
    return np.asarray(alike * memory**apart)


def estimated(cells: Cells, columns: Floats, residual: Floats, space: Floats) -> Covariance:
    r"""Restricted maximum likelihood of the scatter, with weak priors.

    .. math::
        -2 \ln p = \ln|V| + \ln|X^T V^{-1} X| + r^T P r + \text{prior}, \quad
        V = D_\rho + \sum_k \tau_k^2 J_k J_k^T

    `residual` (m,) are the misfits of any fit, `space` (m, q) all that soil, effects and smooth
    shapes could explain; only what is left of them speaks of noise. References: Patterson and
    Thompson, Biometrika 58, 1971.
    """
    several = len(cells.runs) > 1
    basis = _basis(space / cells.std[:, None]) * cells.std[:, None]
    times: tuple[float, ...] = TIMES if several else (0.0,)
    if several and len(cells.runs) < FEW_RUNS:
        times = tuple(t for t in TIMES if t >= GRANTED)
    independent = np.eye(len(cells))
    best, lowest = _climb(cells, columns, residual, basis, independent, 0.0, times)
    if _memory_seen(cells, residual, basis):
        for memory in MEMORY:
            noise = _remembering(cells, memory)
            found, value = _climb(cells, columns, residual, basis, noise, memory, times)
            if value < lowest - 2.0:  # memory must earn its place
                best, lowest = found, value
    freedom = max(float(len(cells) - basis.shape[1]), 2.0)
    best = Scatter(best.scale, best.friction_angle, best.bearing, best.memory, freedom)
    return assembled(cells, columns, best)


def _climb(
    cells: Cells,
    columns: Floats,
    residual: Floats,
    basis: Floats,
    noise: Floats,
    memory: float,
    times: tuple[float, ...],
) -> tuple[Scatter, float]:
    """Coordinate search over the scales, at one memory."""
    same = _same_run(cells)
    channels = len(cells.channels)
    scale, tau = np.ones(channels), np.full(2, times[0])

    def objective(scale: Floats, tau: Floats) -> float:
        std = cells.std * scale[cells.channel]
        matrix = np.outer(std, std) * noise + same * ((columns * tau**2) @ columns.T)
        try:
            factor = np.linalg.cholesky(matrix)
        except np.linalg.LinAlgError:
            return np.inf
        white = np.linalg.solve(factor, np.column_stack([basis, residual]))
        q, r = np.linalg.qr(white[:, :-1])
        left = white[:, -1] - q @ (q.T @ white[:, -1])
        value = 2.0 * np.log(np.diag(factor)).sum()
        value += 2.0 * np.log(np.abs(np.diag(r)) + 1e-300).sum() + left @ left
        value += float(np.sum((np.log(scale) / USUAL_SCALE) ** 2))
        return float(value + np.sum((tau / USUAL_SCATTER) ** 2))

    value = objective(scale, tau)
    for _ in range(2):
        for k in range(2):
            trials = [(objective(scale, _with(tau, k, t)), t) for t in times]
            value, t = min(trials)
            tau = _with(tau, k, t)
        for k in range(channels):
            trials = [
                (objective(_with(scale, k, s), tau), s)
                for s in (1.0, *(scale[k] * f for f in (0.93, 1.0, 1.15, 1.32, 1.75)))
                if s >= 1.0
            ]
            value, s = min(trials)
            scale = _with(scale, k, s)
    found = Scatter(
        scale,
        float(tau[0] * SCATTER["friction_angle"]),
        float(tau[1] * SCATTER["bearing"]),
        memory,
        1.0,
    )
    return found, value


def _with(values: Floats, index: int, value: float) -> Floats:
    changed = values.copy()
    changed[index] = value
    return changed


def _basis(space: Floats) -> Floats:
    """An orthonormal basis of what the columns of a space truly span, (m, r)."""
    u, s, _ = np.linalg.svd(space, full_matrices=False)
    return np.asarray(u[:, s > max(1e-3 * float(s[0]), 0.3)] if s.size else u)
