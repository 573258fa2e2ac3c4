"""Log density of the posterior of soil and shared errors, and its optimum."""

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
from soilml.numerics.importance_sampling import ImportanceSample
from soilml.numerics.smooth_process import LEAST_EIGENVALUE

MOST_EVALUATIONS = 200_000  # Most model evaluations in one call, which bounds memory


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


def most_probable(case: Case, readings: Readings, free: Sequence[Coordinate]) -> Solution:
    """The most probable parameters and errors, with normal priors of the same variances.

    Raises `FitError` where the model has no equilibrium at the measured loads.
    """
    weighted = WeightedRows.of(case, readings, free)
    optimum = global_optimum(weighted.problem, weighted.of_few_rows().problem)
    return descend(weighted.with_noise_at(optimum).problem, optimum.x, with_prior=True)
