"""Entries of the house: what each method is given, what it answers, and the methods by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from datagen.challenge.challenge_files import (
    COLUMNS,
    NONE,
    UNKNOWN,
    Challenge,
    Entry,
)
from soilml.arrays import Floats
from soilml.config.case import Case, read_case
from soilml.errors import FitError
from soilml.fitting.predictions import forces
from soilml.fitting.readings import Readings, stack_readings
from soilml.fitting.row_order import with_order_columns
from soilml.io.csv_file import read_csv
from soilml.io.read_table import read_table
from soilml.io.table import Table
from soilml.physics.operating_point import AFTER_CAMPAIGN, FROM_ORDER
from soilml.quantities import CHANNELS

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
    def read(folder: Path, challenge: Challenge) -> SetData:
        """Read the folder of a set."""
        case = read_case(folder / "model.toml")
        columns, _ = read_csv(folder / "held_out.csv", lambda names: names, "run,slip,load_N")
        runs = with_order_columns(case, read_table(folder / "runs.csv"), FROM_ORDER)
        return SetData(case, runs, Table(columns), challenge.causes)

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


#: A method: what it answers for a set, with a seed.
Method = Callable[[SetData, int], Answer]
#: Module and function of each method; `sbi` needs the library of that name.
METHODS = {
    "gap": "linear_entries:gap_entry",
    "stepwise": "linear_entries:stepwise_entry",
    "lasso": "linear_entries:lasso_entry",
    "gp": "process_entry:process_entry",
    "sbi": "simulation_entry:simulation_entry",
}


def house_entry(
    challenge: Challenge, name: str, seed: int = 0, progress: Callable[[int], None] | None = None
) -> Entry:
    """The entry of a method of the house, a key of `METHODS`.

    seed: Of its random draws; each set has its own.
    progress: Called with the number of sets that are done.

    Raises `FitError` for a set that the method cannot predict.
    """
    module, _, function = METHODS[name].partition(":")
    method: Method = getattr(import_module(f"datagen.challenge.{module}"), function)
    probabilities, draws = {}, {}
    for number, own in enumerate(challenge.rows):
        data = SetData.read(challenge.folder / own, challenge)
        answer = method(data, 1000 * seed + number)
        if not np.isfinite(answer.draws).all():
            raise FitError(f"set {own}: the model of {name} has no equilibrium in a row kept back")
        probabilities[own] = stated(answer.causes, challenge.causes)
        draws[own] = answer.draws
        if progress is not None:
            progress(number + 1)
    return Entry(name, probabilities, draws)


def stated(weights: Mapping[str, float], causes: tuple[str, ...]) -> Floats:
    """Probabilities of all causes: in proportion to these weights, but for `OTHER_CAUSE`.

    Equal ones where there is no weight.
    """
    equal = np.full(len(causes), 1.0 / len(causes))
    share = np.asarray([weights.get(cause, 0.0) for cause in causes])
    share = share / share.sum() if share.sum() > 0.0 else equal
    return np.asarray((1.0 - OTHER_CAUSE) * share + OTHER_CAUSE * equal)


def with_other_cause(weights: Mapping[str, float]) -> dict[str, float]:
    """The weights of named causes and `none`, normalised, with `OTHER_CAUSE` for `unknown`."""
    total = sum(weights.values())
    if not total > 0.0:
        return {NONE: 1.0 - OTHER_CAUSE, UNKNOWN: OTHER_CAUSE}
    return {n: (1.0 - OTHER_CAUSE) * w / total for n, w in weights.items()} | {UNKNOWN: OTHER_CAUSE}


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
