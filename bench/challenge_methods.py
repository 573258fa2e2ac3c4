"""Methods that enter the challenge: the gap workflow, and a Gaussian process without physics."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from gap_baselines import gaussian_process, process_features
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.config.case import Case, read_case
from soilml.config.measurement_noise import Discrepancy
from soilml.fitting.coordinates import select_free
from soilml.fitting.covariance import discrepancy_process
from soilml.fitting.predictions import forces, linearise
from soilml.fitting.readings import Readings, stack_readings
from soilml.fitting.row_order import with_order_columns
from soilml.gap import GapReport, gap
from soilml.inference.constants import SCATTER_UNITS
from soilml.inference.gaussian_terms import scatter_columns
from soilml.io.csv_file import read_csv
from soilml.io.read_table import read_table
from soilml.io.table import Table
from soilml.physics.operating_point import AFTER_CAMPAIGN, FROM_ORDER
from soilml.quantities import CHANNELS, column

COLUMNS = tuple(column(name) for name in CHANNELS)
#: Answers beside the names of the catalogue: nothing is missing; something that is not listed.
NONE, UNKNOWN = "none", "unknown"
#: Draws of the rows kept back in each entry.
DRAWS = 100
#: Share of the probability that every method divides equally among all causes, since it may be
#: wrong itself; and that methods which do not know of `unknown` leave to it. As large as what the
#: gap workflow leaves to causes outside its catalogue.
OTHER_CAUSE = 0.05


@dataclass(frozen=True)
class SetData:
    """What a method is given of one set; `held` has the operating points of the rows kept back."""

    case: Case
    runs: Table
    held: Table
    causes: tuple[str, ...]

    @staticmethod
    def read(folder: Path, causes: tuple[str, ...]) -> SetData:
        """Read the folder of a set."""
        case = read_case(folder / "model.toml")
        columns, _ = read_csv(folder / "held_out.csv", lambda names: names, "run,slip,load_N")
        runs = with_order_columns(case, read_table(folder / "runs.csv"), FROM_ORDER)
        return SetData(case, runs, Table(columns), causes)

    def joined(self, case: Case) -> tuple[Readings, NDArray[np.bool_]]:
        """Readings of the runs, then of the rows kept back, and which of them are of the runs.

        Those of rows kept back stand for what the case predicts there, so that they have a noise.
        """
        count, blank = len(self.runs), np.full(len(self.held), np.nan)
        columns = {}
        for name in self.runs.columns:
            last = self.held.columns.get(name, blank)
            if name == FROM_ORDER["load_direction"]:
                last = np.full(len(self.held), AFTER_CAMPAIGN[name])
            columns[name] = np.concatenate([self.runs[name], last])
        expected = forces(case, stack_readings(case, Table(columns)).at)
        for name, channel in zip(COLUMNS, CHANNELS, strict=True):
            columns[name][count:] = np.asarray(getattr(expected, channel))[count:]
        readings = stack_readings(case, Table(columns))
        return readings, np.asarray(readings.row < count)

    def by_row(self, draws: Floats) -> Floats:
        """Draws (d, channels rows) as readings are stacked, in the form (d, rows, channels)."""
        return np.stack(np.split(draws, len(COLUMNS), axis=1), axis=-1)


@dataclass(frozen=True)
class Answer:
    """Probabilities of some causes, and draws (d, rows, channels) of the rows kept back."""

    causes: Mapping[str, float]
    draws: Floats


def stated(weights: Mapping[str, float], causes: tuple[str, ...]) -> Floats:
    """Probabilities of all causes: in proportion to these weights, but for `OTHER_CAUSE`.

    Equal ones where there is no weight.
    """
    equal = np.full(len(causes), 1.0 / len(causes))
    share = np.asarray([weights.get(cause, 0.0) for cause in causes])
    share = share / share.sum() if share.sum() > 0.0 else equal
    return np.asarray((1.0 - OTHER_CAUSE) * share + OTHER_CAUSE * equal)


def regression_draws(
    columns: Floats,
    residual: Floats,
    std: Floats,
    runs: NDArray[np.bool_],
    count: int,
    rng: np.random.Generator,
) -> Floats:
    r"""Draws (count, m_h) of residuals of readings kept back, noise included.

    .. math:: r = A w + e, \quad w \sim N(0, I), \quad e \sim N(0, \operatorname{diag}(\sigma^2))

    given those of the runs. A soil parameter, the size of an effect, a smooth error of the model
    and the scatter of the soil are columns of A, each scaled by its prior standard deviation.

    columns (m, q), residual (m,), std (m,): A, r and sigma; r of readings kept back is not used.
    runs (m,): Which readings are of the runs.

    References: Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, eq. 2.8.
    """
    known = columns[runs] / std[runs, None]
    precision = np.eye(columns.shape[1]) + known.T @ known
    root = np.linalg.inv(np.linalg.cholesky(precision))
    mean = root.T @ (root @ (known.T @ (residual[runs] / std[runs])))
    weights = mean + rng.standard_normal((count, len(mean))) @ root
    noise = std[~runs] * rng.standard_normal((count, int(np.sum(~runs))))
    return np.asarray(weights @ columns[~runs].T + noise)


def gap_entry(data: SetData, seed: int) -> Answer:
    """The gap workflow: its posterior probabilities, and the model that it returns.

    The probability that it leaves is divided between `none` and `unknown`; see
    `gap_probabilities`. Rows kept back are predicted by the model to first order, with its smooth
    error and scatter given all readings.
    """
    report = gap(data.case, data.runs, seed=seed)
    case = replace(report.model, remainder=None)
    readings, runs = data.joined(case)
    jacobian, expected = _linear_soil(case, readings)
    parts = [jacobian, discrepancy_process(readings, case.discrepancy, Discrepancy()).columns]
    found = report.variance_components
    for i, (name, unit) in enumerate(SCATTER_UNITS.items()):
        if size := found.get(f"{name}_std", 0.0) / unit:
            column = size * scatter_columns(case, readings)[:, i]
            of_run = readings.run[readings.row]
            parts.append(
                np.where(of_run[:, None] == np.arange(len(readings.runs)), column[:, None], 0)
            )
    scale = [found.get(f"noise_scale_{name}", 1.0) for name in COLUMNS]
    std = readings.std * np.asarray(scale)[readings.channel]
    rng = np.random.default_rng(seed)
    residual = readings.measured - expected
    draws = regression_draws(np.column_stack(parts), residual, std, runs, DRAWS, rng)
    return Answer(gap_probabilities(report), data.by_row(expected[~runs] + draws))


def gap_probabilities(report: GapReport) -> dict[str, float]:
    """Probabilities of causes, of which one is right, by a report of the gap workflow.

    Those of the catalogue are the report's, scaled down where their sum exceeds what it leaves to
    other causes. The rest is shared by `none`, with the probability of no gap, and by `unknown`.
    All of it is for `none` where the report sees no gap.
    """
    total = sum(report.probabilities.values())
    shrunk = min(1.0, (1.0 - OTHER_CAUSE) / total) if total > 0.0 else 1.0
    left = 1.0 - shrunk * total
    none = 1.0 if report.status == "no-gap" else 1.0 - report.gap_probability
    rest = {NONE: left * none, UNKNOWN: left * (1.0 - none)}
    return {n: shrunk * p for n, p in report.probabilities.items()} | rest


def _linear_soil(case: Case, readings: Readings) -> tuple[Floats, Floats]:
    """Columns (m, p) of the free parameters by prior standard deviations, and predictions (m,)."""
    free = select_free(case, None)
    at = np.asarray([c.prior.fraction(c.nominal) for c in free])
    found = linearise(case, free, np.clip(at, 0.0, 1.0), readings)
    std = np.asarray([c.fraction_precision for c in free]) ** -0.5
    return found.jacobian * std, found.prediction


def process_entry(data: SetData, seed: int) -> Answer:
    """A Gaussian process of slip, load and covariates; all causes are equally likely to it.

    References: Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, section 2.2.
    """
    features = process_features(data.runs)
    draws = []
    for i, name in enumerate(COLUMNS):
        measured = data.runs[name]
        centre, scale = np.mean(measured), float(np.median(data.case.noise[name].std(measured)))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of lengths at their bounds
            process = gaussian_process(features(data.runs).shape[1])
            process.fit(features(data.runs), (measured - centre) / scale)
            drawn = process.sample_y(features(data.held), DRAWS, random_state=3 * seed + i)
        draws.append(centre + scale * drawn.T)
    return Answer({}, np.stack(draws, axis=-1))


#: What each method answers for a set, with a seed.
METHODS: dict[str, Callable[[SetData, int], Answer]] = {
    "gap": gap_entry,
    "gp": process_entry,
}
