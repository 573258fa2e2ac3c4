"""What an explanation leaves: its size and place, and the remainder that is written."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.config.measurement_noise import Discrepancy
from soilml.config.remainder import MOST_POINTS, Remainder, RemainderPart
from soilml.fitting.covariance import USUAL
from soilml.fitting.least_squares import Solution
from soilml.fitting.levels import Levels
from soilml.fitting.readings import Readings
from soilml.gap.results import RegionScore, RemainingDiscrepancy
from soilml.inference.constants import INTERVAL_FACTOR
from soilml.inference.explanation import Explanation
from soilml.inference.posterior import Posterior
from soilml.numerics.prior import UNIFORM_PRECISION
from soilml.numerics.subspaces import project_out
from soilml.quantities import QUANTITIES, column
from soilml.report.numbers import decimal, shown_unit

#: Amplitude in usual ones below which no discrepancy of a channel is stated.
LEAST_AMPLITUDE = 0.1
#: Largest variance of the logarithm of an amplitude that counts: little is known of such a one.
MOST_LOG_VARIANCE = 0.5
#: Bins along slip and along load of the discrepancy map at most, and readings that a region needs.
SLIP_BINS, LOAD_BINS, MIN_READINGS = 4, 3, 2
#: Variance of the process that the points may leave out anywhere at the readings, as a fraction of
#: it and, where that is less, of the variance of the noise.
LEFT_OUT, LEFT_OUT_OF_NOISE = 1e-3, 0.04
#: Information on a weight, relative to its prior, below which it is not written.
LEAST_INFORMATION = 0.01
#: Decimals of the written weights, whose prior standard deviation is one.
DECIMALS = 5


def remaining_discrepancy(
    posterior: Posterior, before: Explanation, after: Explanation
) -> dict[str, RemainingDiscrepancy]:
    """Root mean square discrepancy of each channel beside two hypotheses, by column."""
    readings, std = posterior.terms.readings, posterior.std
    old, new = (posterior.discrepancy(node) for node in (before, after))
    found = {}
    for i, name in enumerate(readings.channels):
        own = readings.channel == i
        if not own.any():
            continue
        parts = np.stack([old, new, old / std, new / std])[:, own]
        old_value, new_value, old_sigma, new_sigma = np.sqrt(np.mean(parts**2, axis=1)).tolist()
        unit, where = QUANTITIES[name].unit, ""
        k = np.flatnonzero(own)[int(np.argmax(np.abs(new[own])))]
        if new[k] != 0.0:
            factor, shown = shown_unit(unit)
            where = (
                f"measured {'above' if new[k] > 0.0 else 'below'} the model by up to "
                f"{decimal(abs(factor * float(new[k])), 2)} {shown}, at slip "
                f"{readings.slip[k]:.2f} under {readings.load[k]:.3g} N"
            )
        found[column(name)] = RemainingDiscrepancy(
            unit, old_value, new_value, old_sigma, new_sigma, where
        )
    return found


def discrepancy_amplitudes(
    posterior: Posterior, parts: Sequence[tuple[float, Explanation]]
) -> dict[str, float]:
    """Standard deviation of the discrepancy of each channel, by column, in the column's unit.

    Root mean square over the weighted explanations, the probability that it is present and that of
    its amplitude, with the factor of intervals; a channel with hardly any is left out.
    """
    terms, square = posterior.terms, np.zeros(posterior.terms.channels)
    for weight, node in parts:
        at = node.beside.at
        curvature = node.linear.evaluate(at).curvature[: terms.channels]
        spread = np.minimum(1.0 / np.maximum(curvature, 1e-9), MOST_LOG_VARIANCE)
        square += weight * (1.0 - node.share_without) * (terms.amplitude(at) * np.exp(spread)) ** 2
    amplitude = INTERVAL_FACTOR * np.sqrt(square / sum(weight for weight, _ in parts))
    return {
        column(name): float(a * usual)
        for name, a, usual in zip(terms.readings.channels, amplitude, terms.usual, strict=True)
        if a > LEAST_AMPLITUDE and usual > 0.0
    }


def discrepancy_map(posterior: Posterior, soil: Solution) -> list[RegionScore]:
    r"""Score of each region of the data against the fit of the soil alone, the largest first.

    .. math:: z_i = g_{\perp i} \cdot r / |g_{\perp i}|

    with whitened residuals r, and a common shift g of the readings of the region, whitened and
    without what the soil can imitate. Its sign is that of the mean residual. Outliers count in
    none. p is the probability that the largest of so many independent normal scores is as far from
    zero; correlated scores make it an upper bound.

    References: Rao, Proc. Cambridge Phil. Soc. 44, 1948; Sidak, Journal of the American Statistical
    Association 62, 1967.
    """
    readings, std, whiten = posterior.terms.readings, posterior.std, posterior.whiten
    parts = regions(readings)
    if not parts:
        return []
    fit = soil.whitened_by(whiten)
    shifts = np.stack([np.where(inside, std, 0.0) for *_, inside in parts], axis=1)
    white = np.asarray(whiten @ shifts)
    left = project_out(white, fit.jacobian)
    norm = np.linalg.norm(left, axis=0)
    seen = norm > 1e-4 * np.maximum(np.linalg.norm(white, axis=0), 1e-300)
    z = np.where(seen, np.abs(left.T @ fit.residual) / np.where(seen, norm, 1.0), 0.0)
    standardised = (readings.measured - fit.prediction) / std
    found = []
    for i in np.argsort(-z, kind="stable"):
        channel, slip, load, inside = parts[i]
        signed = math.copysign(z[i], np.mean(standardised[inside]))
        p = -np.expm1(len(parts) * np.log1p(-math.erfc(z[i] / math.sqrt(2.0))))
        p = max(float(p), float(np.finfo(float).tiny))
        found.append(RegionScore(column(channel), slip, load, signed, p))
    return found


#: A channel, ends of slips and of loads (N), and which readings (m,) of it are between.
Region = tuple[str, tuple[float, float], tuple[float, float], NDArray[np.bool_]]


def regions(readings: Readings) -> list[Region]:
    """Channel by slip bin by load bin, those with enough readings."""
    slips = _bins(readings.slip, readings.slip_levels, SLIP_BINS)
    loads = _bins(readings.load, readings.load_levels, LOAD_BINS)
    found = []
    for (i, name), slip, load in product(enumerate(readings.channels), slips, loads):
        inside = (readings.channel == i) & (slip[0] <= readings.slip) & (readings.slip <= slip[1])
        inside &= (load[0] <= readings.load) & (readings.load <= load[1])
        if inside.sum() >= MIN_READINGS:
            found.append((name, slip, load, inside))
    return found


def _bins(values: Floats, levels: Levels, count: int) -> list[tuple[float, float]]:
    """Bins with nearly equal numbers of levels, from the lowest to the highest value of each."""
    parts = np.array_split(np.arange(levels.count), min(count, levels.count))
    own = [values[np.isin(levels.index, part)] for part in parts]
    return [(float(part.min()), float(part.max())) for part in own]


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
        value, vector = np.linalg.eigh(np.eye(own.shape[1]) - spread[these, these])
        kept = value > LEAST_INFORMATION  # small parts of the information are left out
        weights = tuple(mean[these].round(DECIMALS).tolist())
        known = _written(vector[:, kept] * np.sqrt(np.minimum(value[kept], 1.0)))
        written.append(replace(blank, mean=weights, known=known, shared=_written(moved[these])))
    earlier = () if case.remainder is None else case.remainder.parts
    return Remainder((*earlier, *written))


def _written(rows: Floats) -> tuple[tuple[float, ...], ...]:
    return tuple(map(tuple, rows.round(DECIMALS).tolist()))


def _blank_parts(
    posterior: Posterior, amplitude: Floats, std: Floats
) -> list[tuple[RemainderPart, Floats]]:
    """Range and points of each channel and gear with a remainder, and columns (m, k) of it."""
    terms, case, found = posterior.terms, posterior.problem.case, []
    readings = terms.readings
    gears = list(case.gears) or [""]
    driven = readings.driven_by(gears[0])
    for i, name in enumerate(readings.channels):
        if amplitude[i] < LEAST_AMPLITUDE or terms.usual[i] == 0.0:
            continue
        declared = case.discrepancy.get(column(name), USUAL)
        for gear in gears:
            own = (readings.channel == i) & ((driven == gear) if len(gears) > 1 else True)
            if not own.any():
                continue
            slip, load = readings.slip[own], readings.load[own]
            size = amplitude[i] * terms.usual[i]
            quiet = LEFT_OUT_OF_NOISE * (float(np.median(std[own])) / size) ** 2
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
