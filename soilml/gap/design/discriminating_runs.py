"""Runs and checks ranked by how well they would discriminate between explanations."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from soilml.errors import InputError
from soilml.gap.data.stacked_readings import StackedReadings
from soilml.gap.design.run_options import SENSOR_CHECKS, expected_readings, run_options
from soilml.gap.report_parts import NextRun
from soilml.gap.search.candidate_fits import CandidateFit
from soilml.gap.search.cross_validation import covariance_at
from soilml.gap.search.problem import FitProblem
from soilml.gap.statistics.coordinates import EffectCoordinate, linearise, predict_readings
from soilml.gap.statistics.least_squares import GapFit
from soilml.physics.operating_point import COVARIATES
from soilml.quantities import column

Floats = NDArray[np.float64]

#: Sigma at which a discrimination is capped: beyond it, more makes no practical difference.
MAX_DISCRIMINATION = 10.0
#: Explanations that are compared, and proposals that are listed.
COMPARED, LISTED = 5, 8
#: Relative singular value below which the rival's parameters cannot be determined by the rows.
LEAST_SQUARES_TOLERANCE = 1e-10

#: Whitened difference (m,) of two explanations on some rows, and the rival's Jacobian (m, p).
Difference = tuple[Floats, Floats]


def next_runs(problem: FitProblem, explanations: Sequence[CandidateFit]) -> list[NextRun]:
    """Runs and checks ranked by how well they discriminate the first explanation from the others.

    The discrimination is the expected increase, in sigma, of the misfit of a rival that adapts all
    its parameters to the present and the new rows together. With fewer than two explanations there
    is nothing to discriminate.
    """
    if len(explanations) < 2:
        return []
    fits = {"+".join(c.names): c.fit for c in explanations[:COMPARED]}
    first, *rivals = fits.values()
    whiten = problem.covariance.whiten
    present = [_difference(first, rival, problem.readings, whiten) for rival in rivals]
    proposals = []
    for option in run_options(problem.readings):
        try:
            readings = expected_readings(option, problem.readings, first.fitted())
            whiten = covariance_at(problem, first, readings).whiten
            sigmas = [
                _discrimination(rival, old, _difference(first, rival, readings, whiten))
                for rival, old in zip(rivals, present, strict=True)
            ]
        except (InputError, np.linalg.LinAlgError):
            continue
        if not np.isfinite(sigmas).all():
            continue
        rows = _rows(readings, fits)
        proposals.append(NextRun(option.kind, option.text, _mean_capped(sigmas), rows))
    for kind, (text, std_after) in SENSOR_CHECKS.items():
        sigmas = [_check_discrimination(first, rival, std_after) for rival in rivals]
        if max(sigmas) > 0.0:
            proposals.append(NextRun(kind, text, _mean_capped(sigmas), ()))
    return sorted(proposals, key=lambda run: -run.discrimination)[:LISTED]


def _mean_capped(sigmas: Sequence[float]) -> float:
    """Mean discrimination from the rivals, each capped at `MAX_DISCRIMINATION`."""
    return float(np.mean([min(sigma, MAX_DISCRIMINATION) for sigma in sigmas]))


def _difference(
    first: GapFit, rival: GapFit, readings: StackedReadings, whiten: Floats
) -> Difference:
    expected = predict_readings(first.case, first.coordinates, first.x[None, :], readings)[0]
    rival_expected, jacobian = linearise(rival.case, rival.coordinates, rival.x, readings)
    return whiten @ (expected - rival_expected), whiten @ jacobian


def _discrimination(rival: GapFit, present: Difference, new: Difference) -> float:
    """Sigma that new rows add between an explanation and a rival adapted to all rows."""
    increase = _adapted_misfit(rival, [present, new]) - _adapted_misfit(rival, [present])
    return float(np.sqrt(max(increase, 0.0)))


def _adapted_misfit(rival: GapFit, parts: Sequence[Difference]) -> float:
    """Squared sigma that remain after the rival has adapted its parameters, prior included."""
    prior = np.diag([1.0 / c.std for c in rival.coordinates])
    difference = np.concatenate([*[d for d, _ in parts], -rival.x * np.diag(prior)])
    jacobian = np.vstack([*[j for _, j in parts], prior])
    if not (np.isfinite(difference).all() and np.isfinite(jacobian).all()):
        return float("nan")
    step = np.linalg.lstsq(jacobian, difference, rcond=LEAST_SQUARES_TOLERANCE)[0]
    return float(np.sum((difference - jacobian @ step) ** 2))


def _check_discrimination(first: GapFit, rival: GapFit, std_after: dict[str, float]) -> float:
    """Sigma by which a check of the sensors would reject one of two explanations."""
    largest = 0.0
    for fit in (first, rival):
        for c, value in zip(fit.coordinates, fit.values().values(), strict=True):
            if isinstance(c, EffectCoordinate) and not c.is_shape and c.effect in std_after:
                largest = max(largest, abs(value) / std_after[c.effect])
    return largest


def _rows(readings: StackedReadings, fits: dict[str, GapFit]) -> tuple[dict[str, float], ...]:
    """Operating points of a run with the prediction of each explanation."""
    rows = len(readings.run)
    columns: dict[str, Floats] = {
        "slip": np.asarray(readings.at.slip),
        "load_N": np.asarray(readings.at.load),
    }
    for field, key in COVARIATES.items():
        if getattr(readings.at, field) is not None:
            columns[key] = np.broadcast_to(getattr(readings.at, field), (rows,))
    for name, fit in fits.items():
        y = predict_readings(fit.case, fit.coordinates, fit.x[None, :], readings)[0]
        for i, channel in enumerate(readings.channels):
            columns[f"{column(channel)} if {name}"] = y[readings.channel == i]
    return tuple({key: float(values[r]) for key, values in columns.items()} for r in range(rows))
