"""Nonlinear least squares on the full model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.errors import FitError, MissingLibraryError
from soilml.identification.diagnostics import at_prior_bound, with_warnings
from soilml.identification.fit_result import Fit
from soilml.identification.free_parameters import FreeParameter
from soilml.identification.observations import Observations
from soilml.identification.predictions import (
    input_noise,
    linearised,
    noise_at_prediction,
    predicted,
    readings,
    stack_readings,
)
from soilml.quantities import column

Floats = NDArray[np.float64]

#: Points of the prior looked at, and how many of the best are then descended from.
LOOKS = 64
STARTS = 4
#: Two descents that end this close, as shares of the priors, found the same optimum.
SAME = 1e-4
#: Squared residuals, summed, that as many parameters as readings should never leave.
UNEXPLAINED = 9.0
#: Precision of a uniform distribution over the unit interval: 1 / its variance.
UNIFORM = 12.0
#: Residual, in standard deviations, of a row that has no equilibrium at a trial.
NO_ANSWER = 1e3


@dataclass(frozen=True)
class _Optimum:
    u: Floats  # (p,) fractions of the priors
    residual: Floats  # (cells,) in standard deviations
    slope: Floats  # (cells, p)

    @property
    def cost(self) -> float:
        return float(self.residual @ self.residual)


def nonlinear(case: Case, data: Observations, free: Sequence[FreeParameter]) -> Fit:
    r"""Weighted, bounded least squares from several starts.

    .. math:: \min_\theta \sum_i \left(\frac{y_i - f(s_i, W_i; \theta)}{\sigma_i}\right)^2

    over the priors' ranges, with noise of slip and load carried into sigma (effective variance).
    Noise that is a share is taken of the prediction: of the reading it would draw the fit low, by
    about twice its square, since readings that err low would count for more.
    The covariance is that of the linearised problem together with the prior, and the distance
    from the optimum to where the prior would draw it is added: a parameter that the rows do not
    determine keeps an honest width. Where the optimum stands at an end of a prior, values as good
    lie along a valley that bends away from it: covariance and distance are then also taken where
    the prior, as a Gaussian of its width, draws the optimum itself, and the wider std holds.
    References: Bard, Nonlinear Parameter Estimation, 1974; Orear, Am. J. Phys. 50(10), 1982
    (effective variance).
    """
    undeclared = [c for c in data.channels if not c.declared]
    if undeclared and data.cells <= len(free):
        raise FitError(
            f"{data.cells} readings cannot give {len(free)} parameters and their own noise; "
            "declare it in [noise]"
        )
    reading, declared = readings(data)
    std = np.where(np.isfinite(declared), declared, _first_guess(data))
    nominal = np.asarray([f.prior.fraction(f.nominal) for f in free])
    best = _best(case, data, free, reading, std, nominal)
    for _ in range(3 if undeclared else 1):
        declared = noise_at_prediction(case, data, free, best.u)
        total = np.hypot(declared, input_noise(case, data, free, best.u))
        std = np.where(np.isfinite(total), total, _estimated(data, reading, best, std, len(free)))
        best = _descended(case, data, free, reading, std, best.u)
    centre = best
    if np.any(at_prior_bound(best.u)):
        centre = _descended(case, data, free, reading, std, best.u, UNIFORM)
    return _finished(case, data, free, best, centre, undeclared=bool(undeclared))


def _finished(
    case: Case,
    data: Observations,
    free: Sequence[FreeParameter],
    best: _Optimum,
    centre: _Optimum,
    *,
    undeclared: bool,
) -> Fit:
    p, cells = len(free), len(best.residual)
    freedom = cells - p
    misfit = best.cost / freedom if freedom > 0 else float("nan")
    # residuals beyond the declared noise are noise too, whatever causes them
    expected = 1.0 + 2.0 * np.sqrt(2.0 / freedom) if freedom > 0 else UNEXPLAINED / cells
    per_reading = misfit if freedom > 0 else best.cost / cells
    surplus = not undeclared and per_reading > expected
    scale = per_reading if surplus else 1.0
    inverse = np.linalg.inv(best.slope.T @ best.slope / scale + UNIFORM * np.eye(p))
    pulled = inverse @ (UNIFORM * (0.5 - best.u))
    spread = np.sqrt(np.diag(inverse))
    bent = np.linalg.inv(centre.slope.T @ centre.slope / scale + UNIFORM * np.eye(p))
    beside = np.hypot(np.sqrt(np.diag(bent)), centre.u - best.u)
    wide = np.maximum(np.hypot(spread, pulled), beside)
    total = inverse * np.outer(wide / spread, wide / spread)
    rate = np.asarray([float(f.prior.rate(best.u[i : i + 1])[0]) for i, f in enumerate(free)])
    fit = Fit(
        method="nonlinear",
        names=tuple(f.path for f in free),
        units=tuple(f.unit for f in free),
        values=np.asarray([float(f.prior.at(best.u[i : i + 1])[0]) for i, f in enumerate(free)]),
        covariance=total * np.outer(rate, rate),
        warnings=(),
        rows_used=len(data.slip),
        left={f.path: float(np.sqrt(UNIFORM) * spread[i]) for i, f in enumerate(free)},
        misfit=per_reading if surplus else misfit,
        channels=tuple(column(c.name) for c in data.channels),
    )
    return with_warnings(
        fit, case, data, free, best.u, surplus=bool(surplus), undeclared=undeclared
    )


def _best(
    case: Case,
    data: Observations,
    free: Sequence[FreeParameter],
    reading: Floats,
    std: Floats,
    nominal: Floats,
) -> _Optimum:
    """The lowest optimum; among equally low ones the nearest to the middle of the prior."""
    try:
        from scipy.stats import qmc
    except ImportError:
        raise MissingLibraryError("identify needs scipy: pip install 'soilml[ground]'") from None
    looks = np.vstack([nominal, qmc.Sobol(len(free), scramble=True, rng=7).random(LOOKS)])
    y = stack_readings(data, predicted(case, free, looks, data.at))
    if np.isnan(y).any(axis=1).all():
        raise FitError(
            "the model carries these loads nowhere in the prior: check load_N, kphi, n and [gear]"
        )
    residual = np.nan_to_num((y - reading) / std, nan=NO_ANSWER)
    order = np.argsort((residual**2).sum(axis=1), kind="stable")
    found: list[_Optimum] = []
    for i in dict.fromkeys([int(i) for i in order[:STARTS]] + [0]):
        found.append(_descended(case, data, free, reading, std, looks[i]))
        if len(found) == 2 and np.abs(found[0].u - found[1].u).max() < SAME:
            break  # two starts, one optimum
    lowest = min(f.cost for f in found)
    level = [f for f in found if f.cost <= lowest + 0.02]
    return min(level, key=lambda f: float(np.sum((f.u - 0.5) ** 2)))


def _descended(
    case: Case,
    data: Observations,
    free: Sequence[FreeParameter],
    reading: Floats,
    std: Floats,
    start: Floats,
    draw: float = 0.0,
) -> _Optimum:
    """The optimum below a start; with the precision `draw` of a prior that draws to its middle."""
    from scipy.optimize import least_squares

    last: dict[bytes, tuple[Floats, Floats]] = {}

    def around(u: Floats) -> tuple[Floats, Floats]:
        key = u.tobytes()
        if key not in last:
            last.clear()
            y, slope = linearised(case, data, free, u)
            residual = np.nan_to_num((y - reading) / std, nan=NO_ANSWER)
            last[key] = residual, np.nan_to_num(slope / std[:, None])
        return last[key]

    pull = np.sqrt(draw)
    found = least_squares(
        lambda u: np.append(around(u)[0], pull * (u - 0.5)),
        np.clip(start, 1e-6, 1.0 - 1e-6),
        jac=lambda u: np.vstack([around(u)[1], pull * np.eye(len(u))]),
        bounds=(0.0, 1.0),
        ftol=1e-10,
        xtol=1e-9,
        gtol=1e-10,
    )
    residual, slope = around(found.x)
    return _Optimum(u=found.x, residual=residual, slope=slope)


def _first_guess(data: Observations) -> Floats:
    """A twentieth of each channel's size, (cells,), until residuals tell its noise."""
    parts = []
    for channel in data.channels:
        kept = channel.reading[np.isfinite(channel.reading)]
        parts.append(np.full(kept.size, 0.05 * float(np.sqrt(np.mean(kept**2))) + 1e-12))
    return np.concatenate(parts)


def _estimated(data: Observations, reading: Floats, best: _Optimum, std: Floats, p: int) -> Floats:
    """Noise of each channel from its residuals, (cells,)."""
    off, start = best.residual * std, 0
    parts = []
    for channel in data.channels:
        size = int(np.isfinite(channel.reading).sum())
        own = off[start : start + size]
        freedom = max(size - p * size / reading.size, 1.0)
        floor = 1e-6 * float(np.sqrt(np.mean(reading[start : start + size] ** 2))) + 1e-15
        parts.append(np.full(size, max(float(np.sqrt(own @ own / freedom)), floor)))
        start += size
    return np.concatenate(parts)
