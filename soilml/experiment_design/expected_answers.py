"""Which row to measure next, by the answers that a model file would give with it."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case, take_case
from soilml.errors import FitError, SoilmlError
from soilml.experiment_design.design import (
    Advice,
    CandidateGrid,
    CandidateRow,
    RatedRow,
    best_row,
    repeated_points,
)
from soilml.experiment_design.expected_variance import predicted_readings
from soilml.experiment_design.parameter_samples import samples_of_moments
from soilml.fitting.coordinates import select_free
from soilml.io.toml_settings import Settings
from soilml.physics.operating_point import Operating
from soilml.quantities import CHANNELS

if TYPE_CHECKING:
    from soilml.onboard.estimator import Estimator
    from soilml.onboard.memory import Memory

#: Soils from which a reading of each candidate is simulated: an advice then takes a second.
OUTCOMES = 12
#: Rows up to which each answer is that of all rows at once; of more rows it is a step of memory.
RUN_ROWS = 32
#: Tables and keys of a recipe that a case contains, or that concern the sampling of rows only.
CASE_KEYS = {"gear", "soil", "effect", "noise", "discrepancy", "operating", "rows", "seed", "runs"}
GRID_SIZE = 4  # Candidate slips, and loads, in the ranges of a recipe


def advise_by_answers(
    estimator: Estimator,
    case: Case,
    grid: CandidateGrid,
    mean: Floats,
    covariance: Floats,
    readings: Mapping[str, Floats],
    box: Mapping[str, tuple[float, float]],
) -> Advice:
    r"""Rate every slip and load by the variance that the file itself answers after that row.

    .. math:: E \operatorname{Var}(\theta) \approx
        \frac{1}{J} \sum_j \operatorname{Var}_\text{file}(\theta | y_{1..n}, y_j)

    Readings y_j are simulated for soils of the estimate, with the noise of the case; all candidates
    share soils and noise. The sequence has two rows.

    estimator, case, grid: The file; model, prior and noise of its recipe; slips and loads of its
        training.
    mean, covariance: The estimate (q,), (q, q) of the readings.
    readings: Inputs of the file by name, (rows,), as they were estimated.
    box: Narrower prior of the answers, if there is one.

    Raises `FitError` where at every point of the grid some soil does not carry the wheel.
    """
    measured = Operating(slip=np.atleast_1d(readings["slip"]), load=np.atleast_1d(readings["load"]))
    channels = tuple(name for name in CHANNELS if name in estimator.inputs)
    candidates = grid.candidates([channels])
    repeated = repeated_points(measured, channels)
    every = [*candidates, *repeated]
    outcomes = _simulated(estimator, case, every, mean, covariance, readings)
    driven = [row for row in candidates if row in outcomes]
    if not driven:
        raise FitError("at each slip and load some soils that are still possible carry no wheel")
    before = [_Answers.to(estimator, readings, box)] * OUTCOMES
    first = [_rated(row, before, outcomes[row]) for row in driven]
    best = best_row(first, estimator.names, None)
    after = [before[0].after(row) for row in outcomes[best.candidate]]
    second = [_rated(row, after, outcomes[row][::-1]) for row in driven]
    return Advice(
        names=estimator.names,
        current_fraction=np.sqrt(np.diag(covariance)) / estimator.prior.std,
        choices=tuple(first),
        repetitions=tuple(
            _rated(row, before, outcomes[row]) for row in repeated if row in outcomes
        ),
        sequence=(best, best_row(second, estimator.names, None)),
        excluded_points=len(candidates) - len(driven),
    )


Row = Mapping[str, float]


@dataclass(frozen=True)
class _Answers:
    """A file that has read rows (rows,) by name: all of them, or the memory of many."""

    estimator: Estimator
    box: Mapping[str, tuple[float, float]]
    rows: Mapping[str, Floats]
    memory: Memory | None = None

    @staticmethod
    def to(
        estimator: Estimator, rows: Mapping[str, Floats], box: Mapping[str, tuple[float, float]]
    ) -> _Answers:
        """After these rows."""
        count = np.size(rows["slip"])
        if estimator.sets is None or count <= RUN_ROWS:
            return _Answers(estimator, box, {k: np.resize(v, count) for k, v in rows.items()})
        return _Answers(estimator, box, {}, estimator.step(estimator.start(), **rows)[1])

    def after(self, row: Row) -> _Answers:
        """After another row."""
        if self.memory is None:
            return replace(self, rows=self._with(row))
        return replace(self, memory=self.estimator.step(self.memory, **row)[1])

    def variance(self, row: Row) -> Floats:
        """Variance (q,) after another row, in units of the prior's."""
        if self.memory is None:
            found = self.estimator.run(**self._with(row))
        else:
            found = self.estimator.step(self.memory, **row)[0]
        found = found.within(**self.box) if self.box else found
        return np.asarray((found.std / self.estimator.prior.std) ** 2)

    def _with(self, row: Row) -> dict[str, Floats]:
        return {name: np.append(values, row[name]) for name, values in self.rows.items()}


def _rated(candidate: CandidateRow, before: Sequence[_Answers], rows: Sequence[Row]) -> RatedRow:
    """A candidate by its simulated readings, each after the rows before it."""
    left = [answers.variance(row) for answers, row in zip(before, rows, strict=True)]
    return RatedRow(candidate, np.sqrt(np.mean(left, axis=0)))


def _simulated(
    estimator: Estimator,
    case: Case,
    candidates: Sequence[CandidateRow],
    mean: Floats,
    covariance: Floats,
    like: Mapping[str, Floats],
) -> dict[CandidateRow, list[dict[str, float]]]:
    """Readings of each candidate that every soil of the estimate carries, by name as in `like`."""
    free = select_free(case, None)
    soils = samples_of_moments(free, estimator.names, mean, covariance, OUTCOMES)
    slip, load = np.asarray([(c.slip, c.load) for c in candidates]).T
    predicted = predicted_readings(case, soils, Operating(slip=slip, load=load))
    normal = np.random.default_rng(0).standard_normal((len(predicted.channels), 1, OUTCOMES))
    read = dict(zip(predicted.channels, predicted.y + normal * predicted.std, strict=True))
    shares = _shares(like)
    found = {}
    for k in np.flatnonzero(predicted.drivable).tolist():
        rows = []
        for j in range(OUTCOMES):
            row = {"slip": float(slip[k]), "load": float(load[k])}
            row |= {name: float(read[name][k, j]) for name in like if name in read}
            row |= {f"{name}_std": share * abs(row[name]) for name, share in shares.items()}
            rows.append({name: row.get(name, np.nan) for name in like})
        found[candidates[k]] = rows
    return found


def _shares(rows: Mapping[str, Floats]) -> dict[str, float]:
    """Standard deviation over reading, in the middle of the rows, of each quantity that has one."""
    return {
        name: float(np.nanmedian(np.abs(rows[f"{name}_std"] / np.asarray(rows[name]))))
        for name in rows
        if f"{name}_std" in rows
    }


def trained_case(estimator: Estimator) -> tuple[Case, CandidateGrid] | None:
    """Case and candidate grid of a file for one wheel; None where no case can represent it."""
    read = {*estimator.inputs}
    if estimator.per_row or not {"slip", "load"} < read <= {"slip", "load", *CHANNELS}:
        return None
    try:
        recipe = json.loads(estimator.metadata["recipe"])
        if recipe.keys() - CASE_KEYS or recipe["operating"].keys() - {"slip", "load_N"}:
            return None
        case = take_case(Settings(recipe, estimator.path))
        ends = [recipe["operating"][key] for key in ("slip", "load_N")]
        pairs = [entry["range"] if isinstance(entry, dict) else entry for entry in ends]
        slips, loads = ([float(x) for x in np.linspace(a, b, GRID_SIZE)] for a, b in pairs)
        return case, CandidateGrid(tuple(slips), tuple(loads))
    except (SoilmlError, AttributeError, KeyError, TypeError, ValueError):
        return None
