"""The remainder beside a fit, as the model file carries it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from soilml.arrays import Floats
from soilml.config.measurement_noise import Discrepancy
from soilml.config.remainder import MOST_POINTS, Remainder, RemainderPart
from soilml.fitting.covariance import USUAL
from soilml.gap.verdict.remainder import LEAST_AMPLITUDE
from soilml.inference.explanation import Explanation
from soilml.inference.posterior import Posterior
from soilml.numerics.prior import UNIFORM_PRECISION
from soilml.quantities import column

#: Variance of the process that the points may leave out anywhere at the readings, as a fraction of
#: it and, where that is less, of the variance of the noise.
LEFT_OUT, LEFT_OUT_OF_NOISE = 1e-3, 0.04
#: Information on a weight, relative to its prior, below which it is not written.
LEAST_INFORMATION = 0.01
#: Decimals of the written weights, whose prior standard deviation is one.
DECIMALS = 5


def learned_remainder(
    posterior: Posterior, parts: Sequence[tuple[float, Explanation]]
) -> Remainder | None:
    r"""Posterior of the remainder beside weighted explanations, at the amplitudes they support.

    Residuals are those of the mean prediction, squared amplitudes the mean ones; noise, scatter and
    the uncertainty of soil and effects are those of the likeliest.

    With columns C of the functions at the readings, residuals r and the covariance V of noise and
    scatter, the weights of all channels are normal:

    .. math:: \mu = S C^T V^{-1} r, \quad S = (I + C^T V^{-1} C)^{-1}

    Soil and effects, with the Jacobian X and the covariance P of the fit, move them by
    :math:`-S C^T V^{-1} X P^{1/2}`. Correlations between the weights of different channels, which
    run-to-run scatter causes, are left out. None where no channel has a remainder.

    References: Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, eqs. 2.8 and
    2.11; Kennedy and O'Hagan, J. R. Statist. Soc. B 63(3), 2001.
    """
    terms, case, total = posterior.terms, posterior.problem.case, sum(w for w, _ in parts)
    _, node = max(parts, key=lambda part: part[0])
    size = np.sqrt(sum(w * terms.amplitude(one.at) ** 2 for w, one in parts) / total)
    at = replace(
        node.at,
        log=np.append(np.log(np.maximum(size, 1e-9)), node.at.log[len(size) :]),
        present=bool(size.any()),
    )
    blanks = _blank_parts(posterior, size, terms.std(node.at))
    if not blanks:
        return case.remainder
    columns = np.concatenate([own for _, own in blanks], axis=1)
    whiten = terms.whiten(terms.without_discrepancy(at), node.outliers)
    white = np.asarray(whiten @ columns)
    mean_residual = np.sum([w * one.linear.residual for w, one in parts], axis=0) / total
    residual = np.asarray(whiten @ mean_residual)
    information = white.T @ white
    spread = np.linalg.inv(np.eye(len(information)) + information)
    mean = spread @ (white.T @ residual)
    fit = node.fit.whitened_by(terms.whiten(at, node.outliers))
    normal = fit.jacobian.T @ fit.jacobian + np.diag(fit.precision + UNIFORM_PRECISION)
    of_tests = fit.soil_tests.rates(fit.x)
    root = np.linalg.inv(np.linalg.cholesky(normal + of_tests.T @ of_tests)).T
    moved = spread @ (white.T @ (whiten @ fit.derivatives)) @ root
    written, first = [], 0
    for blank, own in blanks:
        these = slice(first, first + own.shape[1])
        first = these.stop
        known = _factor(np.eye(own.shape[1]) - spread[these, these])
        written.append(
            replace(
                blank,
                mean=tuple(mean[these].round(DECIMALS).tolist()),
                known=_written(known),
                shared=_written(moved[these]),
            )
        )
    earlier = () if case.remainder is None else case.remainder.parts
    return Remainder((*earlier, *written))


def _blank_parts(
    posterior: Posterior, amplitude: Floats, std: Floats
) -> list[tuple[RemainderPart, Floats]]:
    """Range and points of each channel and gear with a remainder, and columns (m, k) of it."""
    terms, case, found = posterior.terms, posterior.problem.case, []
    readings = terms.readings
    gears = list(case.gears) or [""]
    driven = np.broadcast_to(
        np.asarray(gears[0] if readings.at.gear is None else readings.at.gear), len(readings.run)
    )[readings.row]
    for i, name in enumerate(readings.channels):
        if amplitude[i] < LEAST_AMPLITUDE or terms.usual[i] == 0.0:
            continue
        declared = _declared(case.discrepancy, name)
        for gear in gears:
            own = (readings.channel == i) & ((driven == gear) if len(gears) > 1 else True)
            if not own.any():
                continue
            slip, load = readings.slip[own], readings.load[own]
            size = amplitude[i] * terms.usual[i]
            noise = float(np.median(std[own]))
            quiet = LEFT_OUT_OF_NOISE * (noise / size) ** 2
            part = RemainderPart(
                column=column(name),
                gear=gear,
                amplitude=float(size),
                usual=float(terms.usual[i]),
                slip_length=declared.slip_length,
                log_load_length=declared.log_load_length,
                slip=(float(slip.min()), float(slip.max())),
                load=(float(load.min()), float(load.max())),
                points=_spread_points(slip, load, declared, min(LEFT_OUT, quiet)),
                mean=(),
                known=(),
                shared=(),
            )
            columns = np.zeros((len(readings), len(part.points)))
            columns[own] = part.amplitude * part.functions(slip, load)
            found.append((part, columns))
    return found


def _declared(discrepancy: Mapping[str, Discrepancy], channel: str) -> Discrepancy:
    return discrepancy.get(column(channel), USUAL)


def _spread_points(
    slip: Floats, load: Floats, lengths: Discrepancy, left_out: float
) -> tuple[tuple[float, float], ...]:
    """Points of the readings that represent the process: each where most of it is left out.

    Pivoted Cholesky factorisation; Golub and Van Loan, Matrix Computations, section 4.2.8.
    """
    pairs = np.unique(np.column_stack([slip, load]).round(6), axis=0)
    z = np.column_stack(
        [pairs[:, 0] / lengths.slip_length, np.log(pairs[:, 1]) / lengths.log_load_length]
    )
    left, factor = np.ones(len(z)), np.zeros((len(z), 0))
    taken: list[int] = []
    while len(taken) < min(MOST_POINTS, len(z)) and left.max() > left_out:
        i = int(np.argmax(left))
        correlation = np.exp(-0.5 * ((z - z[i]) ** 2).sum(axis=1))
        new = (correlation - factor @ factor[i]) / np.sqrt(left[i])
        factor = np.column_stack([factor, new])
        left = np.maximum(left - new**2, 0.0)
        taken.append(i)
    return tuple((float(s), float(w)) for s, w in pairs[taken])


def _factor(information: Floats) -> Floats:
    """F (k, r) with F F^T the information on the weights, small parts left out."""
    value, vector = np.linalg.eigh(information)
    kept = value > LEAST_INFORMATION
    return np.asarray(vector[:, kept] * np.sqrt(np.minimum(value[kept], 1.0)))


def _written(rows: Floats) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(float(v) for v in row) for row in rows.round(DECIMALS))
