"""Drawbar pull and climbable slope against slip, for draws of the soil and of the model's error."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.config.measurement_noise import Discrepancy, range_with_zero
from soilml.fitting.operating_points import operating_points
from soilml.fitting.predictions import forces_of_one_gear
from soilml.fitting.readings import declared_std
from soilml.io.table import Table
from soilml.numerics.root_finding import rising_root
from soilml.numerics.smooth_process import process_columns, slip_load_points
from soilml.physics.model import Model
from soilml.physics.operating_point import Operating
from soilml.quantities import column
from soilml.remarks import Remark
from soilml.traction.soil_draws import SoilDraws

#: Upper end of the slopes searched, rad (86 degrees); steeper ones are clipped to it.
LARGEST_SLOPE = 1.5
#: Kinds of effects of the test rig and its sensors, which do not act on a vehicle.
EXCLUDED_KINDS = ("rig", "sensor")


@dataclass(frozen=True)
class Traction:
    """Pull and slope of a running gear under one load, for n draws of the soil and m slips.

    Attributes
    ----------
    load
        Vertical load, N.
    slip
        Slips (m,).
    pull
        Drawbar pull on level ground, N (n, m); NaN where the soil does not carry the load.
    slope
        Slope that a vehicle climbs steadily, rad (n, m); negative where it only descends.
    """

    load: float
    slip: Floats
    pull: Floats
    slope: Floats

    @property
    def largest_pull(self) -> Floats:
        """The largest drawbar pull of each draw, N (n,)."""
        return _largest(self.pull)

    @property
    def best_slip(self) -> Floats:
        """The slip at the largest drawbar pull, (n,)."""
        return self._slip_of(self.pull)

    @property
    def steepest_slope(self) -> Floats:
        """The steepest slope of each draw, rad (n,)."""
        return _largest(self.slope)

    @property
    def steepest_slip(self) -> Floats:
        """The slip at the steepest slope, (n,)."""
        return self._slip_of(self.slope)

    @property
    def failed_fraction(self) -> float:
        """Fraction of draws and slips without equilibrium."""
        return float(np.mean(~np.isfinite(self.pull)))

    @property
    def rising_fraction(self) -> float:
        """Fraction of draws whose pull still increases at the highest slip."""
        return float(np.mean(self.best_slip == self.slip[-1]))

    def _slip_of(self, values: Floats) -> Floats:
        slip = self.slip[np.argmax(np.nan_to_num(values, nan=-np.inf), axis=1)]
        return np.where(np.isfinite(values).any(axis=1), slip, np.nan)


def on_a_vehicle(case: Case) -> Case:
    """The case without the effects of the test rig and its sensors."""
    own = tuple(e for e in case.model.effects if e.about.kind not in EXCLUDED_KINDS)
    return replace(case, model=Model(case.model.gear, own))


def excluded_effects(case: Case) -> list[Remark]:
    """A remark on the effects that `on_a_vehicle` leaves out, if there are any."""
    names = [e.name for e in case.model.effects if e.about.kind in EXCLUDED_KINDS]
    text = f"effects of rig and sensors are excluded: {', '.join(names)}"
    return [Remark("effects-excluded", text, tuple(names), "note")] if names else []


def predict_traction(
    case: Case,
    draws: SoilDraws,
    load: float,
    slip: Floats,
    covariates: Mapping[str, float] | None = None,
    pull_error: Floats | None = None,
) -> Traction:
    r"""Pull and slope for n draws of the soil at m slips under a load.

    The slope :math:`\alpha` is the one on which the drawbar pull under the normal component of the
    load equals the component along the slope,

    .. math:: W \sin\alpha = DP(s, W \cos\alpha)

    with all wheels equal. Effects of the rig and the sensors are removed from the model. Does not
    hold with load transfer between axles, across the slope, in turns, nor where the slope itself is
    close to sliding.

    Parameters
    ----------
    case
        Model and soil.
    draws
        Draws (n, p) of soil parameters.
    load
        Vertical load on level ground, N.
    slip
        Slips (m,).
    covariates
        Speed, pass number and slip angle, where an effect needs them.
    pull_error
        Error of the model for each draw and slip, N (n, m), which is added to the pull. On a slope
        it is taken as on level ground: the logarithm of the load changes there by less than a
        usual correlation length.

    References
    ----------
    Wong, Theory of Ground Vehicles, chapter 3.
    """
    case = on_a_vehicle(case)
    count = len(draws.values)
    rows, columns = (grid.ravel() for grid in np.indices((count, len(slip))))
    error = np.zeros(rows.size) if pull_error is None else pull_error.ravel()

    def drawbar_pull(index: NDArray[np.int64], normal_load: Floats) -> Floats:
        soils = draws.of(case, rows[index])
        at = Operating(slip=slip[columns[index]], load=normal_load, **dict(covariates or {}))
        return np.asarray(forces_of_one_gear(soils, at).drawbar_pull + error[index])

    level = drawbar_pull(np.arange(rows.size), np.full(rows.size, load))
    carried = np.flatnonzero(np.isfinite(level))

    def excess_angle(angle: Floats) -> Floats:
        """Slope less the one that the pull on it balances."""
        normal_load = load * np.cos(angle)
        return np.asarray(angle - np.arctan(drawbar_pull(carried, normal_load) / normal_load))

    bound = np.full(carried.size, LARGEST_SLOPE)
    guess = np.arctan(level[carried] / load)
    root = rising_root(excess_angle, -bound, bound, guess, np.ones(carried.size))
    slope = np.full(rows.size, np.nan)
    slope[carried] = np.where(root.converged | (root.x >= LARGEST_SLOPE), root.x, np.nan)
    shape = (count, len(slip))
    return Traction(float(load), slip, level.reshape(shape), slope.reshape(shape))


def _largest(values: Floats) -> Floats:
    largest = np.nan_to_num(values, nan=-np.inf).max(axis=1)
    return np.where(np.isfinite(largest), largest, np.nan)


@dataclass(frozen=True)
class PullDiscrepancy:
    """Errors of the predicted pull, N: one for each draw of the soil, load and slip.

    amplitude: Standard deviation before any reading, N.
    posterior, prior: Draws (n, loads, m) of the error, given the measured pulls and before them.
    """

    amplitude: float
    posterior: Floats
    prior: Floats


def draw_pull_discrepancy(
    case: Case,
    table: Table,
    draws: SoilDraws,
    loads: Sequence[float],
    slip: Floats,
    *,
    noise_scale: float | None = 1.0,
) -> PullDiscrepancy | None:
    r"""Draws of the error under the loads (N) at the slips (m,); None where none is declared.

    A [remainder] of the pull takes the place of what [discrepancy] declares.

    The error is C w with the columns C of the process and standard normal weights w. Given the soil
    of a draw, the k measured pulls leave residuals r with noise D, and the weights are normal with

    .. math:: E[w] = M^{-1} B^T D^{-1} r, \quad \operatorname{cov}[w] = M^{-1}, \quad
        M = I + B^T B, \quad B = D^{-1} C

    case: Model, noise and discrepancy.
    table: Rows with status ok. A share of the range is that of their pulls, or, where no pull was
        measured, of the median prediction for these rows.
    draws: Draws of the soil, given the same rows.
    noise_scale: Factor on noise and discrepancy; None to leave the measured pulls out.

    References: Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, eqs. 2.7 and
    2.8.
    """
    key = column("drawbar_pull")
    own, learned = case.discrepancy.get(key), case.remainder
    learned = learned if learned is not None and key in learned.columns else None
    if own is None and learned is None:
        return None
    predicted = _predicted_pull(case, draws, table)
    reading = std = np.full(len(table), np.nan)
    if key in table:
        reading, std = table[key], declared_std(case, table, key)
    typical = reading if np.isfinite(reading).any() else np.median(predicted, axis=0)
    scale = 1.0 if noise_scale is None else noise_scale
    asked_load, asked_slip = (g.ravel() for g in np.meshgrid(loads, slip, indexing="ij"))
    at = np.append(table["slip"], asked_slip), np.append(table["load_N"], asked_load)
    if learned is not None:  # about its mean, which is in the predictions
        amplitude = float(np.max(learned.mean_and_std("drawbar_pull", *at)[1]))
        columns = learned.process_columns("drawbar_pull", *at, fitted_anew=True)
    else:
        own = own or Discrepancy()
        amplitude = own.amplitude(range_with_zero(typical))
        columns = process_columns(
            slip_load_points(*at, own.slip_length, own.log_load_length), amplitude
        )
    at_rows, at_asked = np.split(scale * columns, [len(table)])
    used = np.isfinite(reading) & (std > 0.0) & (noise_scale is not None)
    rng = np.random.default_rng(0)
    shape = (len(predicted), at_rows.shape[1])
    before = rng.standard_normal(shape)
    residual = np.nan_to_num(reading - predicted)[:, used] / (scale * std[used])
    basis = at_rows[used] / (scale * std[used, None])
    precision = np.eye(shape[1]) + basis.T @ basis
    mean = np.linalg.solve(precision, basis.T @ residual.T).T
    # with M = L L^T, the weights L^-T z have the covariance M^-1
    spread = np.linalg.solve(np.linalg.cholesky(precision).T, rng.standard_normal(shape).T).T
    grid = (len(predicted), len(loads), len(slip))
    after = ((mean + spread) @ at_asked.T).reshape(grid)
    return PullDiscrepancy(amplitude, after, (before @ at_asked.T).reshape(grid))


def _predicted_pull(case: Case, draws: SoilDraws, table: Table) -> Floats:
    """Pull of each draw at the rows, N (n, k); NaN where the soil does not carry the load."""
    soils = draws.of(case, np.arange(len(draws.values))[:, None])
    pull = forces_of_one_gear(soils, operating_points(table)).drawbar_pull
    return np.broadcast_to(np.asarray(pull), (len(draws.values), len(table)))
