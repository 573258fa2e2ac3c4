"""How well the runs of a blind set separate its cause from the soil and from other effects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from soilml.config.case import Case
from soilml.fitting.candidate_effects import candidate_effects
from soilml.fitting.coordinates import select_free
from soilml.fitting.effect_signatures import effect_signatures
from soilml.fitting.predictions import linearise
from soilml.fitting.readings import Readings, stack_readings
from soilml.gap.identifiability import similarity
from soilml.inference.constants import SCATTER_UNITS
from soilml.inference.gaussian_terms import scatter_columns
from soilml.io.table import Table
from soilml.physics.effects import EFFECTS
from soilml.quantities import column

#: Correlation lengths of the discrepancy that is counted as noise, in slip and log load: the
#: middle of those from which it is drawn.
SLIP_LENGTH, LOG_LOAD_LENGTH = 0.3, 0.6


@dataclass(frozen=True)
class Separation:
    """What the runs show of a cause, in sigma of noise, scatter and discrepancy together.

    `signal` is the norm of its signature after the soil has adapted, `snr` that norm times the
    sine of the angle to the most similar effect, `rival`. With several causes, the weakest.
    """

    signal: float
    snr: float
    rival: str


def separation(case: Case, table: Table, truth: dict[str, Any]) -> Separation:
    """The separation of a set's causes at their true sizes and on the true soil."""
    causes = {cause["name"]: cause for cause in truth["causes"]}
    if not causes:
        return Separation(0.0, 0.0, "")
    true_case = case.with_values(truth["soil"])
    readings = stack_readings(true_case, table)
    effects = candidate_effects(case, EFFECTS)
    columns = {s.name: s.column for s in effect_signatures(true_case, readings, effects)[0]}
    own = _own_signatures(causes, columns, truth, readings)
    free = select_free(case, None)
    at = np.asarray([f.prior.fraction(truth["soil"][f.path]) for f in free])
    soil = linearise(true_case, free, at, readings).jacobian
    lower = np.linalg.cholesky(_covariance(true_case, truth, readings))
    white = {n: np.linalg.solve(lower, c) for n, c in (columns | own).items()}
    white_soil = np.linalg.solve(lower, soil)
    found = []
    for name in causes:
        others = [white[other][:, None] for other in causes if other != name]
        rivals = {n: white[n] for n in columns if n not in causes}
        space = np.hstack([white_soil, *others])
        norm, cosine = similarity({name: white[name]} | rivals, space)
        nearest, signal = int(np.argmax(cosine[0])), float(norm[0])
        snr = signal * float(np.sqrt(max(0.0, 1.0 - cosine[0, nearest] ** 2)))
        found.append(Separation(signal, snr, [name, *rivals][nearest]))
    return min(found, key=lambda s: s.snr)


def _own_signatures(
    causes: dict[str, Any],
    columns: dict[str, np.ndarray],
    truth: dict[str, Any],
    readings: Readings,
) -> dict[str, np.ndarray]:
    """The change of the readings by each cause: as simulated, or by the effects if several act."""
    if len(causes) == 1:
        change = {
            name: np.asarray(truth["runs_steady"][column(name)])
            - np.asarray(truth["runs_without"][column(name)])
            for name in readings.channels
        }
        return {next(iter(causes)): readings.stack(change)}
    size = truth["plan"]["size"]
    none = np.zeros(len(readings))
    return {name: size * columns.get(name, none) for name in causes}


def _covariance(case: Case, truth: dict[str, Any], readings: Readings) -> np.ndarray:
    """Noise, run-to-run scatter, and a smooth discrepancy of the true size; (m, m)."""
    covariance = np.diag(readings.std**2)
    scatter = truth["scatter_std"]
    if scatter["modulus_fraction"] > 0.0:
        units = np.asarray(
            [
                scatter["friction_angle_rad"] / SCATTER_UNITS["friction_angle"],
                scatter["modulus_fraction"] / SCATTER_UNITS["bearing"],
            ]
        )
        by_run = scatter_columns(case, readings) * units
        run = readings.run[readings.row]
        covariance += (run[:, None] == run) * (by_run @ by_run.T)
    share = truth["plan"]["discrepancy"]
    if share > 0.0:
        slip, load = readings.slip / SLIP_LENGTH, np.log(readings.load) / LOG_LOAD_LENGTH
        distance = np.subtract.outer(slip, slip) ** 2 + np.subtract.outer(load, load) ** 2
        largest = [np.abs(truth["runs_steady"][column(n)]).max() for n in readings.channels]
        std = share * np.asarray(largest)[readings.channel]
        same = readings.channel[:, None] == readings.channel
        covariance += same * np.outer(std, std) * np.exp(-0.5 * distance)
    return np.asarray(covariance)
