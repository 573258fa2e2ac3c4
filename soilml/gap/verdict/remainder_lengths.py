"""Correlation lengths, amplitude and noise of a remainder, by channel, from what a fit leaves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from soilml.arrays import Floats, Integers
from soilml.config.measurement_noise import LOG_LOAD_LENGTH, SLIP_LENGTH
from soilml.errors import InputError
from soilml.fitting.covariance import USUAL
from soilml.fitting.least_squares import Solution
from soilml.fitting.operating_points import gear_numbers
from soilml.gap.evidence.covariance import Covariance, assemble_covariance
from soilml.gap.evidence.linearised_fit import AMPLITUDES
from soilml.gap.evidence.problem import FitProblem, MarginalFit, StartedFit, fit_many
from soilml.numerics.smooth_process import slip_load_points, squared_exponential
from soilml.quantities import column

#: Factors on the usual correlation lengths that are tried, in slip and in the logarithm of load.
FACTORS = (0.15, 0.25, 0.4, 0.6, 1.0, 1.6, 2.5)
#: Factor on the usual correlation length in slip of a remainder that is the same at all slips.
STEADY_FACTOR = 20.0
#: Standard deviation of the logarithm of a length about that of the usual one.
LENGTH_STD = 1.0
#: Amplitudes that are tried, in usual ones.
SIZES = np.append(AMPLITUDES, [40.0, 63.0, 100.0])
#: Factors on the declared noise that are tried where no scatter is granted.
NOISE_FACTORS = np.asarray([1.0, 1.25, 1.6, 2.0, 2.5, 3.2])
#: Decrease of -2 ln of the likelihood from which other lengths, another noise, or a remainder of a
#: channel without one, are written.
LEAST_GAIN = 6.0
#: Readings of a channel that the lengths are fitted to, at most.
MOST_READINGS = 100
SWEEPS = 2


@dataclass(frozen=True)
class _Likeliest:
    """The likeliest process of a channel, and what its -2 ln of the likelihood is."""

    value: float
    slip_length: float
    log_load_length: float
    amplitude: float  # in usual ones
    noise: float  # factor on the noise


def with_fitted_lengths(
    problem: FitProblem, marginal: MarginalFit
) -> tuple[FitProblem, MarginalFit]:
    r"""The problem with lengths and noise, and the fit with amplitudes, that its residuals support.

    .. math:: -2 \ln p = \ln|V + a^2 K(l)| + r^T [V + a^2 K(l)]^{-1} r + \text{prior}

    with the residuals r of a channel and the covariance V of their noise and scatter, minimised
    over lengths l and amplitudes a on a grid. V is that of the problem, or independent noise of
    a size that is fitted too: what changes fast with slip or load is no noise, and the variance
    components of a search take it for noise or for scatter between runs. The process of a channel
    whose discrepancy the case declares stays as it is. A process that predicts readings of its
    channel no better than none does, each from the others, gives way to one that is the same at all
    slips, since few readings tell no function of slip; it is left out where that predicts no better
    either: see `_gains`. Soil and effects, which were fitted beside it, are then fitted again, and
    else stay as they are.

    References: Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, eq. 5.8.
    """
    granted = _likeliest(problem, marginal, problem.covariance, NOISE_FACTORS[:1])
    declared = _declared(problem, np.ones(len(problem.readings.channels)))
    alone = _likeliest(problem, marginal, declared, NOISE_FACTORS)
    found, covariance = granted, problem.covariance
    if sum(p.value for p in alone.values()) < sum(p.value for p in granted.values()) - LEAST_GAIN:
        noise = np.ones(len(problem.readings.channels))
        noise[list(alone)] = [p.noise for p in alone.values()]
        found, covariance = alone, _declared(problem, noise)
    before = replace(problem, covariance=covariance)
    problem, amplitude = _with_processes(before, found, marginal.evidence.amplitude)
    fit, fitted = marginal.fit, marginal.evidence.amplitude
    predicts = _predicts(problem, fit, amplitude)
    if doubtful := [i for i in found if amplitude[i] > 0.0 and not predicts[i]]:
        steady = _likeliest(before, marginal, covariance, NOISE_FACTORS[:1], steady=True)
        problem, amplitude = _with_processes(problem, {i: steady[i] for i in doubtful}, amplitude)
    while True:
        predicts = _predicts(problem, fit, amplitude)
        for i in found:
            amplitude[i] *= predicts[i]
        if not np.any((amplitude == 0.0) & (fitted > 0.0)):
            break
        fit, fitted = _fitted_again(problem, fit, amplitude), amplitude.copy()
    evidence = replace(marginal.evidence, amplitude=amplitude)
    return problem, replace(marginal, fit=fit, evidence=evidence)


def _with_processes(
    problem: FitProblem, processes: Mapping[int, _Likeliest], amplitude: Floats
) -> tuple[FitProblem, Floats]:
    """The problem with the lengths of processes, by channel, and all amplitudes (channels,)."""
    amplitude, discrepancy = amplitude.copy(), dict(problem.case.discrepancy)
    for i, process in processes.items():
        amplitude[i] = process.amplitude
        discrepancy[column(problem.readings.channels[i])] = replace(
            USUAL, slip_length=process.slip_length, log_load_length=process.log_load_length
        )
    return replace(problem, case=replace(problem.case, discrepancy=discrepancy)), amplitude


def _some_of(problem: FitProblem, channel: int) -> Integers:
    """Numbers of the readings of a channel, evenly spread, `MOST_READINGS` at most."""
    own = np.flatnonzero(problem.readings.channel == channel)
    return own[:: -(-len(own) // MOST_READINGS)]


def _fitted_again(problem: FitProblem, fit: Solution, amplitude: Floats) -> Solution:
    """A fit beside a remainder of these amplitudes; as it was where the model refuses that."""
    whiten = problem.discrepancy.whiten(amplitude)
    started = StartedFit(fit.case, fit.coordinates, fit.start_values(), whiten, fit.linearisation)
    (found,) = fit_many(problem, [started])
    return fit if isinstance(found, InputError) else found


def _declared(problem: FitProblem, noise: Floats) -> Covariance:
    """Independent noise, of these factors on the declared one by channel, (channels,)."""
    readings = problem.readings
    components = replace(
        problem.covariance.components,
        noise_scale=noise,
        friction_angle_std=0.0,
        bearing_std=0.0,
        autocorrelation=0.0,
    )
    return assemble_covariance(readings, np.zeros((len(readings), 2)), components)


def _likeliest(
    problem: FitProblem,
    marginal: MarginalFit,
    covariance: Covariance,
    noise: Floats,
    *,
    steady: bool = False,
) -> dict[int, _Likeliest]:
    """The likeliest process of each channel without a declared discrepancy, by its number.

    steady: Of those that are the same at all slips.
    """
    readings, usual = problem.readings, problem.discrepancy.process.usual
    residual = readings.measured - marginal.fit.prediction
    gear = gear_numbers(readings.at)[readings.row]
    found = {}
    for i, name in enumerate(readings.channels):
        if usual[i] == 0.0 or column(name) in problem.case.discrepancy:
            continue
        own = _some_of(problem, i)
        known = covariance.matrix[np.ix_(own, own)]
        factor = np.linalg.cholesky(known)
        root = np.linalg.inv(factor)
        same_gear = gear[own][:, None] == gear[own]
        found[i] = _of_channel(
            root @ residual[own],
            usual[i] * root,
            readings.slip[own],
            readings.load[own],
            same_gear,
            noise,
            2.0 * float(np.log(np.diag(factor)).sum()),
            0.0 if marginal.evidence.amplitude[i] > 0.0 else LEAST_GAIN,
            steady=steady,
        )
    return found


def _predicts(problem: FitProblem, fit: Solution, amplitude: Floats) -> list[bool]:
    """Whether the process of each channel predicts its residuals better than none does.

    Both of the gains of `_gains` exceed their standard errors.

    References: Vehtari, Gelman and Gabry, Statistics and Computing 27, 2017, eq. 24.
    """
    readings, process = problem.readings, problem.discrepancy.process
    channels = range(len(readings.channels))
    own = np.sort(np.concatenate([_some_of(problem, i) for i in channels]))
    columns = (process.columns * amplitude[process.channel])[own]
    noise, residual = (
        problem.covariance.matrix[np.ix_(own, own)],
        readings.measured - fit.prediction,
    )
    gains = _gains(residual[own], noise, columns @ columns.T) / problem.covariance.std[own] ** 2
    of_channels = [gains[:, readings.channel[own] == i] for i in channels]
    least = [np.sqrt(g.shape[1] * g.var(axis=1)) for g in of_channels]
    return [bool((g.sum(axis=1) > e).all()) for g, e in zip(of_channels, least, strict=True)]


def _gains(residual: Floats, noise: Floats, process: Floats) -> Floats:
    r"""By how much processes K predict the square of each residual better, in two ways, (2, m).

    .. math::
        e_i = [V^{-1} r]_i / [V^{-1}]_{ii}, \quad
        d_i = [K V^{-1} r]_i - [K V^{-1}]_{ii} e_i

    are, from all other residuals r under their covariance V, the error of the prediction of
    residual i, and what the processes alone predict there. The gains are what e_i^2 and
    (r_i - d_i)^2 are below those without processes. What changes with a quantity that is neither
    slip nor load, such as the pass, can be likelier as a process of slip than as noise, and still
    predicts nothing. And scatter between runs, which a model does not have, can be the same in all
    runs where it cancels a process.

    noise, process (m, m): Covariances of noise and scatter, and of the processes.

    References: Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, eq. 5.12.
    """
    errors = []
    for covariance in (noise, noise + process):
        inverse = np.linalg.inv(covariance)
        weights = inverse @ residual
        errors.append(weights / np.diag(inverse))
    means = process @ weights - np.einsum("ij,ji->i", process, inverse) * errors[1]
    return np.stack([errors[0] ** 2 - errors[1] ** 2, residual**2 - (residual - means) ** 2])


def _of_channel(
    white: Floats,
    root: Floats,
    slip: Floats,
    load: Floats,
    same_gear: Floats,
    noise: Floats,
    log_determinant: float,
    needed: float,
    *,
    steady: bool,
) -> _Likeliest:
    """The likeliest process of one channel, with the usual lengths where these are as good.

    steady: The likeliest one that is the same at all slips, with the usual length in load.

    white (m,): Residuals, whitened by their noise. root (m, m): What whitens it, times the usual
    amplitude. log_determinant: Logarithm of the determinant of the noise. needed: Decrease of
    -2 ln of the likelihood from which there is a process at all.
    """
    square = noise[:, None, None] ** 2

    def at(of_slip: float, of_load: float) -> _Likeliest:
        lengths = float(SLIP_LENGTH * of_slip), float(LOG_LOAD_LENGTH * of_load)
        z = slip_load_points(slip, load, *lengths)
        size, vector = np.linalg.eigh(
            root @ np.where(same_gear, squared_exponential(z, z), 0.0) @ root.T
        )
        scale = square + np.maximum(size, 0.0) * SIZES[:, None] ** 2  # noise, size, m
        values = (np.log(scale) + (vector.T @ white) ** 2 / scale).sum(axis=2)
        values += needed * (SIZES > 0.0)
        n, a = np.unravel_index(int(np.argmin(values)), values.shape)
        prior = float(np.sum((np.log([of_slip, of_load]) / LENGTH_STD) ** 2))
        value = float(values[n, a]) + log_determinant + prior
        return _Likeliest(value, *lengths, float(SIZES[a]), float(noise[n]))

    if steady:
        return at(STEADY_FACTOR, 1.0)
    middle = best = 1.0, 1.0
    known = {middle: at(*middle)}
    for _ in range(SWEEPS):
        for axis in range(2):
            for factor in FACTORS:
                pair = (factor, best[1]) if axis == 0 else (best[0], factor)
                if pair not in known:
                    known[pair] = at(*pair)
            best = min(known, key=lambda pair: known[pair].value)
    better = known[best].value < known[middle].value - LEAST_GAIN
    return known[best if better else middle]
