"""Log density of the posterior of soil and shared errors, and samples of both together."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.config.measurement_noise import Discrepancy
from soilml.errors import FitError
from soilml.fitting.coordinates import Coordinate
from soilml.fitting.covariance import (
    discrepancy_process,
    noise_of_operation,
    sensor_columns,
    squared_residuals_and_log_determinant,
)
from soilml.fitting.least_squares import SoilTestTerms, Solution
from soilml.fitting.misfit import WeightedRows
from soilml.fitting.predictions import predict
from soilml.fitting.readings import Readings
from soilml.fitting.scipy_descents import descend, global_optimum
from soilml.fitting.shared_errors import errors_at, with_modelled_errors
from soilml.numerics.importance_sampling import ImportanceSample, importance_sample
from soilml.numerics.smooth_process import LEAST_EIGENVALUE
from soilml.numerics.surface_sampling import MOST_ROUNDS, surface_sample
from soilml.numerics.surrogate_density import SamplingBox

MOST_EVALUATIONS = 200_000  # Most model evaluations in one call, which bounds memory
#: Samples of the normal distribution, and their spread over that of the linearised posterior.
SAMPLES, WIDER = 2048, 1.2
#: Largest standard deviation, in fractions of the priors, of a posterior that is narrow.
NARROW = 0.15
#: Its first samples spread so much more than the linearised one; samples of each round.
MUCH_WIDER, SMALL_ROUND = 1.6, 1024
#: Rows from which on polynomials are tried in the place of the model, which take longer with fewer,
#: and rounds after which they must be accurate enough for the density itself.
FEWEST_ROWS, TEMPERED_ROUNDS = 32, 2
#: Factor on the noise from which on rows are explained by neither soil nor errors, and most rounds
#: then: an answer that nobody should believe takes little time.
UNEXPLAINED, FEW_ROUNDS = 2.0, 4
#: Standard deviations from the middle at which the region ends in which the model is sampled.
REACH = 6.0
MOST_SAMPLED_ROWS = 128  # Most rows where the model is sampled, which bounds the time
#: Effective sample size at which sampling of the model ends, and the numbers of solutions and of
#: samples at which it ends anyway where nothing explains the rows.
ENOUGH, MOST_SOLUTIONS, FEWEST_SAMPLES = 1250.0, 500_000, 4096


class PosteriorDensity:
    """Log posterior density (sets,), up to a constant, of fractions of the priors (sets, p).

    Errors that all rows share and that the model is solved with are parameters too, behind those of
    the soil; each is taken as a reading of zero, in standard deviations. Other errors that all rows
    share are integrated out. Tests of the soil stand behind the readings, as predictions of their
    deviations.
    """

    def __init__(
        self, case: Case, readings: Readings, free: Sequence[Coordinate], noise_scale: float = 1.0
    ) -> None:
        check_declared(readings)
        self.case, self.free = with_modelled_errors(
            case, readings.shared_errors, readings.row_load, free
        )
        self.readings, self.noise_scale = readings, noise_scale
        #: how many of the parameters are errors
        self.errors = len(self.free) - len(free)
        #: how many predictions stand behind those of the readings: errors, and tests of the soil
        self.others = self.errors + len(case.soil_tests)
        self.measured = np.append(readings.measured, np.zeros(self.others))
        self.columns = _by_channel(case, readings)
        self.noisy_input = bool(np.any(readings.slip_std) or np.any(readings.load_std))
        #: noise that slip and load cause, (m,); linearised at the best of the first samples
        self.input_std: Floats | None = None

    def __call__(self, u: Floats) -> Floats:
        """Log density (sets,) of parameter sets `u` (sets, p)."""
        size = max(MOST_EVALUATIONS // len(self.readings.row_slip), 1)
        blocks = [
            self.of_predictions(self.predict(u[i : i + size])) for i in range(0, len(u), size)
        ]
        return np.concatenate(blocks) if blocks else np.zeros(0)

    def of_rows(self, rows: NDArray[np.int64]) -> PosteriorDensity:
        """The density of some of the rows alone."""
        part = copy(self)
        part.readings = self.readings.of_rows(rows)[1]
        part.measured = np.append(part.readings.measured, np.zeros(self.others))
        part.columns = _by_channel(self.case, part.readings)
        part.input_std = None
        return part

    def squared_residuals(self, u: Floats) -> float:
        """Sum of squared residuals in declared standard deviations, of one parameter set (1, p)."""
        y = self.predict(u)
        return float(self._squares_and_log_determinant(y, self._std(y))[0].sum())

    def predict(self, u: Floats) -> Floats:
        """Readings (sets, k) that parameter sets `u` (sets, p) predict, and the others."""
        size = max(MOST_EVALUATIONS // len(self.readings.row_slip), 1)
        y = np.concatenate([self._predict(u[i : i + size]) for i in range(0, len(u), size)])
        if self.noisy_input and self.input_std is None:
            squares = self._squares_and_log_determinant(y, self._std(y))[0]
            self._linearise(u[int(np.argmin(np.nan_to_num(squares, nan=np.inf)))])
        return y

    def linearise_at_mean(self, sample: ImportanceSample) -> bool:
        """Linearise noise of slip and load at the mean of samples; False where there is none."""
        if self.noisy_input:
            self._linearise(sample.mean(sample.u))
        return self.noisy_input

    def of_predictions(self, y: Floats) -> Floats:
        """Log posterior density (sets,) of parameters that predict these readings (sets, k)."""
        size = max(MOST_EVALUATIONS // y.shape[1], 1)
        parts = [self._of_predictions(y[i : i + size]) for i in range(0, len(y), size)]
        return np.concatenate(parts) if parts else np.zeros(0)

    def _of_predictions(self, y: Floats) -> Floats:
        squares, log_determinant = self._squares_and_log_determinant(y, self._std(y))
        # the factor on all noise enters the determinant as a constant, which does not matter
        logs = -0.5 * squares / self.noise_scale**2 - log_determinant
        logs -= 0.5 * (y[:, y.shape[1] - len(self.case.soil_tests) :] ** 2).sum(axis=1)
        return np.where(np.isfinite(logs), logs, -np.inf)

    def _squares_and_log_determinant(self, y: Floats, std: Floats) -> tuple[Floats, Floats]:
        """Squared whitened residuals, and half the log determinant of the covariance, (sets,)."""
        m = len(self.readings)
        groups, shared = self.columns, sensor_columns(self.readings, y[:, :m])
        if shared is not None:  # they act on several channels
            process = _stacked(self.columns)
            process = np.broadcast_to(process, (len(shared), *process.shape))
            groups = (np.concatenate([process, shared], axis=-1),)
        if self.errors:
            groups = (*groups, np.zeros((self.errors, 0)))
        residual = y - self.measured
        squares, log_determinant, stop = np.zeros(len(y)), np.zeros(len(y)), 0
        for columns in groups:
            start, stop = stop, stop + columns.shape[-2]
            own = squared_residuals_and_log_determinant(
                residual[:, start:stop], std[:, start:stop], columns
            )
            squares, log_determinant = squares + own[0], log_determinant + own[1]
        return squares, log_determinant

    def _std(self, y: Floats) -> Floats:
        """Standard deviations (sets, k) of the readings where these are predicted."""
        std = self.readings.noise_at(y[:, : len(self.readings)])
        if self.input_std is not None:
            std = np.asarray(np.hypot(std, self.input_std))
        return np.hstack([std, np.ones((len(y), self.others))]) if self.others else std

    def _predict(self, u: Floats) -> Floats:
        y = predict(self.case, self.free, u, self.readings)
        y = np.hstack([y, errors_at(self.free, u)]) if self.errors else y
        if not self.case.soil_tests:
            return y
        return np.hstack([y, SoilTestTerms(self.case, self.free).deviation(u)])

    def _linearise(self, u: Floats) -> None:
        """Take changes of the readings with slip and load at fractions (p,)."""
        self.input_std = noise_of_operation(self.case, self.readings, self.free, u)


def check_declared(readings: Readings) -> None:
    """Raise `FitError` where the noise of a channel is not declared, with what to write."""
    if undeclared := readings.undeclared:
        lines = ", ".join(f"{name} = '3 %'" for name in undeclared)
        raise FitError(
            f"the posterior method needs the noise of {', '.join(undeclared)}: declare it in "
            f"[noise] of the model file, such as {lines}"
        )


def _by_channel(case: Case, readings: Readings) -> tuple[Floats, ...]:
    """For each channel, columns (m_c, q_c) of its discrepancy at its m_c readings."""
    process = discrepancy_process(
        readings, case.discrepancy, Discrepancy(), LEAST_EIGENVALUE, case.remainder
    )
    return tuple(
        process.columns[np.ix_(readings.channel == i, process.channel == i)]
        for i in range(len(readings.channels))
    )


def _stacked(parts: Sequence[Floats]) -> Floats:
    """Columns (m, q) for all readings, one channel after another; zero outside their channel."""
    stacked = np.zeros((sum(len(p) for p in parts), sum(p.shape[1] for p in parts)))
    row = first = 0
    for part in parts:
        stacked[row : row + len(part), first : first + part.shape[1]] = part
        row, first = row + len(part), first + part.shape[1]
    return stacked


def joint_sample(density: PosteriorDensity, optimum: Solution) -> ImportanceSample:
    """Weighted fractions (n, p) of the priors of soil and errors.

    The region is that of the linearised posterior at the most probable parameters. Polynomials take
    the place of the model where they soon turn out to be accurate there; otherwise the model is
    sampled, of many rows at some that are chosen at random; where nothing explains the rows, for a
    bounded number of solutions.
    """
    start = normal_start(density, optimum)
    density.linearise_at_mean(start)
    rows, p = len(density.readings.row_slip), len(density.free)
    if rows >= FEWEST_ROWS:
        most = FEW_ROUNDS if density.noise_scale > UNEXPLAINED else MOST_ROUNDS
        found = surface_sample(density, p, start, tempered_rounds=TEMPERED_ROUNDS, most_rounds=most)
        if found is not None and density.linearise_at_mean(found):
            found = surface_sample(density, p, found)
        if found is not None:
            return found
    if rows > MOST_SAMPLED_ROWS:
        chosen = np.random.default_rng(0).permutation(rows)[:MOST_SAMPLED_ROWS]
        density = density.of_rows(np.sort(chosen))
    return _of_model(density, start)


def most_probable(case: Case, readings: Readings, free: Sequence[Coordinate]) -> Solution:
    """The most probable parameters and errors, with normal priors of the same variances.

    Raises `FitError` where the model has no equilibrium at the measured loads.
    """
    weighted = WeightedRows.of(case, readings, free)
    optimum = global_optimum(weighted.problem, weighted.of_few_rows().problem)
    return descend(weighted.with_noise_at(optimum).problem, optimum.x, with_prior=True)


def normal_root(density: PosteriorDensity, optimum: Solution) -> Floats:
    """A root (p, p) of the covariance of the linearised posterior, in fractions of the priors."""
    precision = optimum.jacobian.T @ optimum.jacobian / density.noise_scale**2
    prior = np.diag([f.fraction_precision for f in density.free])
    of_tests = optimum.soil_tests.rates(optimum.x)
    prior += of_tests.T @ of_tests
    return np.linalg.cholesky(np.linalg.inv(precision + prior))


def narrow_sample(density: PosteriorDensity, optimum: Solution) -> ImportanceSample | None:
    """Weighted fractions (n, p) of priors of which the posterior is a small part, or None.

    The model itself is sampled, from the linearised posterior on: in ratios of a soil's bearing
    and its exponent the posterior is bent, which a box about its middle would cut off.
    """
    root = normal_root(density, optimum)
    if float(np.sqrt((root**2).sum(axis=1)).max()) > NARROW:
        return None
    density.linearise_at_mean(normal_start(density, optimum))
    around = optimum.x, MUCH_WIDER * root
    return importance_sample(density, len(root), around=around, later=SMALL_ROUND)


def normal_start(density: PosteriorDensity, optimum: Solution) -> ImportanceSample:
    """Samples of the linearised posterior about the most probable parameters, of equal weights."""
    root = normal_root(density, optimum)
    normal = np.random.default_rng(0).standard_normal((SAMPLES, len(optimum.x)))
    u = optimum.x + WIDER * normal @ root.T
    u = np.clip(1.0 - np.abs(1.0 - np.abs(u)), 1e-6, 1.0 - 1e-6)  # reflected at the faces
    return ImportanceSample(u, np.full(SAMPLES, 1.0 / SAMPLES), 0.0)


def _of_model(density: PosteriorDensity, start: ImportanceSample) -> ImportanceSample:
    """Samples of the density itself, in a box about those of a similar one."""
    region = SamplingBox.of(start, REACH)

    def log_density(fractions: Floats) -> Floats:
        u = region.points(fractions)
        inside = np.all((u > 0.0) & (u < 1.0), axis=1)
        logs = np.full(len(u), -np.inf)
        logs[inside] = density(u[inside])
        return logs

    p, most = len(density.free), float("inf")
    if density.noise_scale > UNEXPLAINED:
        most = max(MOST_SOLUTIONS // len(density.readings.row_slip), FEWEST_SAMPLES)
    found = importance_sample(
        log_density,
        p,
        least_effective_size=ENOUGH,
        around=region.middle,
        most_samples=most,
    )
    kept = found.weights > 0.0
    u, weights = region.points(found.u[kept]), found.weights[kept]
    return ImportanceSample(u, weights, found.evidence + region.log_volume)
