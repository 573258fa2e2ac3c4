"""Two model files on runs that were kept back: what each predicts from the first rows of a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.config.measurement_noise import range_with_zero
from soilml.errors import InputError
from soilml.fitting.operating_points import operating_points
from soilml.fitting.predictions import forces_of_one_gear
from soilml.fitting.readings import positive_std
from soilml.io.table import Table
from soilml.onboard.estimate import Estimate
from soilml.onboard.estimator import Estimator
from soilml.onboard.table_estimates import joint_readings
from soilml.quantities import CHANNELS, column

#: Numbers of first rows from which the soil is estimated: the most of which a run has more rows.
FIRST_ROWS = (4, 8, 16)
#: Channels that the board may not read, so that both files estimate from torque alone.
WITHHELD = (column("drawbar_pull"), column("sinkage"))
#: Soils drawn from an estimate, over which a prediction is averaged.
DRAWS = 64


@dataclass(frozen=True)
class BoardCandidate:
    """A model file with the model that predicts by its estimates.

    `case` has the fitted values of what the file does not estimate, and the noise of the sensors.
    """

    estimator: Estimator
    case: Case


@dataclass(frozen=True)
class RunPrediction:
    """The prediction of the later rows of a run by one file.

    Attributes
    ----------
    mean, std : dict of ndarray
        Of the readings by column, (rows,); NaN without equilibrium. The deviation is that of soil,
        noise and declared error of the model.
    """

    mean: dict[str, Floats]
    std: dict[str, Floats]


@dataclass(frozen=True)
class ChannelScore:
    """A channel by one file: root mean square error over the channel's range, and log score.

    The range is that of the readings of all runs that were kept back, with zero. The log score is
    the mean logarithm of the predictive density of a reading, in units of that range.
    """

    error: float
    log_score: float


@dataclass(frozen=True)
class JudgedRun:
    """A run judged from its first rows: later rows, their readings, and both predictions."""

    run: str
    first_rows: int
    rows: Table  # The later rows
    before: RunPrediction
    after: RunPrediction
    scores: dict[str, tuple[ChannelScore, ChannelScore]]  # Before and after, by column


@dataclass(frozen=True)
class Judgement:
    """Both files on all runs that were kept back."""

    runs: tuple[JudgedRun, ...]

    @property
    def channels(self) -> tuple[str, ...]:
        """Columns that were predicted, in the order of the model's channels."""
        found = {key for run in self.runs for key in run.scores}
        return tuple(column(n) for n in CHANNELS if column(n) in found)

    def figures(self) -> dict[str, tuple[ChannelScore, ChannelScore]]:
        """By column the scores before and after, the mean over runs."""
        found = {}
        for key in self.channels:
            before, after = zip(*(r.scores[key] for r in self.runs if key in r.scores), strict=True)
            found[key] = _mean(before), _mean(after)
        return found

    def error(self) -> tuple[float, float]:
        """Root mean square over channels of the errors of `figures` before and after."""
        pairs = self.figures().values()
        before, after = (
            float(np.sqrt(np.mean([pair[i].error ** 2 for pair in pairs]))) for i in (0, 1)
        )
        return before, after

    @property
    def ratio(self) -> float:
        """Error after over error before; below 1 the adapted file is better."""
        before, after = self.error()
        return after / before if before > 0.0 else np.inf


def judge(
    kept_back: Table, before: BoardCandidate, after: BoardCandidate, *, seed: int = 0
) -> Judgement:
    """Judge two files on runs that neither was made from.

    From the torque of the first rows of a run, as many of `FIRST_ROWS` as it has more of, each file
    estimates the soil; its model predicts every measured channel of the later rows, averaged over
    the estimate. Rows are taken in the order of `time_s`, or of the table.

    kept_back: Rows of whole runs.
    seed: Of the soils that are drawn from an estimate.

    Raises `InputError` where no later row can be predicted.
    """
    scale = {
        key: size
        for key in map(column, CHANNELS)
        if key in kept_back and (size := range_with_zero(kept_back[key])) > 0.0
    }
    judged: list[JudgedRun] = []
    for name, rows in kept_back.groups("run"):
        rows = _drivable(rows)
        k = max((k for k in FIRST_ROWS if k < len(rows)), default=0)
        if k:
            first, later = rows.rows(np.arange(k)), rows.rows(np.arange(k, len(rows)))
            pair = [predict_run(c, first, later, scale, seed) for c in (before, after)]
            judged.append(_judged(name, k, later, pair, scale))
    judged = [run for run in judged if run.scores]
    if not judged:
        raise InputError(
            f"{kept_back.source}: no later row of a run that is kept back can be predicted by both "
            "files: a file cannot be judged"
        )
    return Judgement(tuple(judged))


def check_lengths(kept_back: Table) -> None:
    """Raise `InputError` where no run has more rows than the fewest first ones."""
    most = max(len(_drivable(rows)) for _, rows in kept_back.groups("run"))
    if most <= min(FIRST_ROWS):
        raise InputError(
            f"{kept_back.source}: a run that is kept back has {most} rows with slip above 0 and "
            f"torque; needed are more than {min(FIRST_ROWS)}, from which the others are predicted"
        )


def _drivable(rows: Table) -> Table:
    """The rows of a run that a file can read, in the order in which they were driven."""
    if "time_s" in rows and np.isfinite(rows["time_s"]).all():
        rows = rows.rows(np.argsort(rows["time_s"], kind="stable"))
    usable = rows.answered & (rows["slip"] > 0.0) & np.isfinite(rows[column("torque")])
    return rows.rows(usable)


def predict_run(
    candidate: BoardCandidate, first: Table, later: Table, scale: Mapping[str, float], seed: int
) -> RunPrediction:
    """The later rows of a run, predicted from its first rows.

    scale: Range of each channel, by column, to which a declared error of the model is relative.
    """
    seen = {key: values for key, values in first.columns.items() if key not in WITHHELD}
    readings = joint_readings(candidate.estimator, Table(seen, first.source))
    estimate = candidate.estimator.run(**readings)
    soils = _draw_soils(estimate, seed)
    case = candidate.case.with_values(
        {name: soils[:, i, None] for i, name in enumerate(estimate.names)}
    )
    force = forces_of_one_gear(case, operating_points(later))
    mean, std = {}, {}
    for name in CHANNELS:
        key = column(name)
        if key not in scale:
            continue
        values = np.broadcast_to(np.asarray(getattr(force, name)), (DRAWS, len(later)))
        mean[key], spread = _moments(values)
        noise = np.nan_to_num(positive_std(candidate.case, later, key))
        error = _model_error(case, name, later, scale[key])
        std[key] = np.sqrt(spread**2 + noise**2 + error**2)
    return RunPrediction(mean, std)


def _model_error(case: Case, channel: str, rows: Table, size: float) -> Floats:
    """Standard deviation (rows,) of the model's error: of its remainder, else as declared."""
    if case.remainder is not None and case.remainder.of(channel):
        return case.remainder.mean_and_std(channel, rows["slip"], rows["load_N"])[1]
    declared = case.discrepancy.get(column(channel))
    return np.full(len(rows), declared.amplitude(size) if declared else 0.0)


def _draw_soils(estimate: Estimate, seed: int) -> Floats:
    """Soils (draws, q) from an estimate, inside the range of the prior; half mirror the others."""
    half = np.random.default_rng(seed).standard_normal((DRAWS // 2, len(estimate.names)))
    values, vectors = np.linalg.eigh(estimate.covariance)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    soils = estimate.mean + np.concatenate([half, -half]) @ root.T
    return np.asarray(np.clip(soils, estimate.prior.lower, estimate.prior.upper))


def _moments(values: Floats) -> tuple[Floats, Floats]:
    """Mean and standard deviation (rows,) over draws (draws, rows); NaN where most have none."""
    finite = np.isfinite(values)
    enough = finite.sum(axis=0) > DRAWS // 2
    shown = np.where(enough, np.where(finite, values, np.nan), 0.0)
    mean, std = np.nanmean(shown, axis=0), np.nanstd(shown, axis=0)
    return np.where(enough, mean, np.nan), np.where(enough, std, np.nan)


def _judged(
    name: str, k: int, later: Table, pair: Sequence[RunPrediction], scale: Mapping[str, float]
) -> JudgedRun:
    """Scores of both predictions, on the readings that both predict."""
    scores = {}
    for key, size in scale.items():
        known = np.isfinite(later[key])
        for prediction in pair:
            known = known & np.isfinite(prediction.mean[key]) & (prediction.std[key] > 0.0)
        if known.any():
            before, after = (_score(later[key], own, key, size, known) for own in pair)
            scores[key] = before, after
    return JudgedRun(name, k, later, pair[0], pair[1], scores)


def _score(
    reading: Floats, prediction: RunPrediction, key: str, size: float, known: NDArray[np.bool_]
) -> ChannelScore:
    off = (reading - prediction.mean[key])[known]
    std = prediction.std[key][known]
    density = -0.5 * np.log(2.0 * np.pi * (std / size) ** 2) - 0.5 * (off / std) ** 2
    return ChannelScore(float(np.sqrt(np.mean(off**2)) / size), float(np.mean(density)))


def _mean(scores: Sequence[ChannelScore]) -> ChannelScore:
    """The mean over runs: of squared errors, and of log scores."""
    return ChannelScore(
        float(np.sqrt(np.mean([s.error**2 for s in scores]))),
        float(np.mean([s.log_score for s in scores])),
    )
