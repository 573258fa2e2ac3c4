"""Runs and checks ranked by how well they would discriminate between explanations."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from soilml.arrays import Floats
from soilml.errors import InputError, raised
from soilml.fitting.candidate_effects import effect_names
from soilml.fitting.coordinates import rates_at
from soilml.fitting.covariance import Whitening
from soilml.fitting.least_squares import Solution
from soilml.fitting.predictions import (
    Linearisation,
    PredictionRequest,
    linearise_many,
    predict_many,
)
from soilml.fitting.readings import Readings
from soilml.gap.design.planned_readings import readings_like, with_default_covariates
from soilml.gap.design.run_kinds import SENSOR_CHECKS, SOIL_TESTS
from soilml.gap.design.run_options import RunOption, run_options
from soilml.gap.report.results import NextRun
from soilml.inference.explanation import Explanation
from soilml.inference.gaussian_terms import scatter_columns, terms_like
from soilml.inference.posterior import Posterior
from soilml.physics.effects.base import Effect
from soilml.physics.operating_point import COVARIATES
from soilml.quantities import column

#: Sigma at which a discrimination is capped: beyond it, more makes no practical difference.
MAX_DISCRIMINATION = 10.0
#: Sigma below which a run or check is not proposed: six such runs together decide nothing.
MIN_DISCRIMINATION = 0.5
#: Largest difference, in sigma of a reading, of two predictions that count as equal.
SAME_PREDICTION = 0.1
COMPARED = 5  # Explanations that are compared
#: Relative singular value below which the rival's parameters cannot be determined by the rows.
LEAST_SQUARES_TOLERANCE = 1e-10

#: Whitened difference (m,) of two explanations on some rows, and the rival's Jacobian (m, p).
Difference = tuple[Floats, Floats]


def next_runs(posterior: Posterior, explanations: Sequence[Explanation]) -> list[NextRun]:
    """Runs and checks ranked by how well they discriminate the first explanation from the others.

    The discrimination is the expected increase, in sigma, of the misfit of a rival that adapts all
    its parameters to the present and the new rows together. With fewer than two explanations there
    is nothing to discriminate. A run for which every explanation predicts what it predicts for a
    plain repeat is left out, and of runs with equal rows one is listed.
    """
    if len(explanations) < 2:
        return []
    readings, known = posterior.terms.readings, posterior.problem.effects
    fits = {_in_words(node): node.fit for node in explanations[:COMPARED]}
    first, *rivals = fits.values()
    effects = [known[name] for name in _effects_of(fits.values()) if name in known]
    whiten = posterior.whiten
    present = [_difference(whiten, first.prediction, rival.linearisation) for rival in rivals]
    proposals: list[NextRun] = []
    options = _expected(readings, fits, run_options(readings, first.fitted(), effects))
    for run, new in zip(options, _differences_each(posterior, options), strict=True):
        if new is None:
            continue
        _, *others = run.fits.values()
        try:
            sigmas = [
                _discrimination(rival, old, _all_columns(rival, added, other))
                for rival, other, old, added in zip(rivals, others, present, new, strict=True)
            ]
        except np.linalg.LinAlgError:
            continue
        if np.isfinite(sigmas).all():
            rows = _rows(run.readings, dict(zip(run.fits, run.predicted, strict=True)), run.option)
            proposals.append(NextRun(run.option.kind, run.option.text, _mean_capped(sigmas), rows))
    proposals += _static_proposals(fits, present, effects)
    compared = tuple(dict.fromkeys(node.hypothesis.effects for node in explanations[:COMPARED]))
    useful = [
        replace(run, compared=compared)
        for run in _without_equal_rows(proposals)
        if run.discrimination >= MIN_DISCRIMINATION
    ]
    return sorted(useful, key=lambda run: -run.discrimination)


@dataclass(frozen=True)
class _ExpectedRun:
    """A run, the explanations on its gear, and what these predict, (fits, m)."""

    option: RunOption
    fits: Mapping[str, Solution]
    readings: Readings
    predicted: Floats

    def readings_of(self, fit: Solution) -> Readings:
        """The readings, with usual covariates that the effects of a fit need."""
        return replace(self.readings, at=with_default_covariates(self.readings.at, fit.case))


def _in_words(node: Explanation) -> str:
    return "+".join(node.hypothesis.effects) or "soil alone"


def _expected(
    like: Readings, fits: Mapping[str, Solution], options: Iterable[RunOption]
) -> list[_ExpectedRun]:
    """What the explanations predict for runs; those that they refuse, and repeats, are left out."""
    asked: list[tuple[RunOption, dict[str, Solution], int]] = []
    requests: list[PredictionRequest] = []
    for option in options:
        changed = {name: _with_gear(fit, option) for name, fit in fits.items()}
        ways = [option.at] if option.plain is None else [option.at, option.plain]
        for at in ways:
            for fit in changed.values():
                whole = with_default_covariates(at, fit.case)
                readings = Readings.of_every_row(whole, like.channels)
                requests.append(
                    PredictionRequest(fit.case, fit.coordinates, fit.x[None, :], readings)
                )
        asked.append((option, changed, len(ways)))
    answers = iter(predict_many(requests))
    expected = []
    for option, changed, count in asked:
        own = [next(answers) for _ in range(count * len(changed))]
        if any(isinstance(y, InputError) for y in own):
            continue
        y = np.concatenate([raised(one) for one in own]).reshape(count, len(changed), -1)
        case = next(iter(changed.values())).case
        readings = readings_like(option.at, like, case, y[0, 0], option.kind)
        if not _is_plain_repeat(readings, y):
            expected.append(_ExpectedRun(option, changed, readings, y[0]))
    return expected


def _differences_each(
    posterior: Posterior, runs: Sequence[_ExpectedRun]
) -> list[list[Difference] | None]:
    """How the first explanation differs from the others in each run; None where one is refused."""
    requests = [
        PredictionRequest(fit.case, fit.coordinates, fit.x[None, :], run.readings_of(fit))
        for run in runs
        for fit in list(run.fits.values())[1:]
    ]
    linear = iter(linearise_many(requests))
    found: list[list[Difference] | None] = []
    for run in runs:
        one, *others = run.fits.values()
        own = [next(linear) for _ in others]
        try:
            columns = scatter_columns(one.fitted(), run.readings)
            terms, at = terms_like(posterior.terms, posterior.noise, run.readings, columns)
            whiten = terms.whiten(at, np.zeros(len(run.readings), bool))
            found.append([_difference(whiten, run.predicted[0], raised(line)) for line in own])
        except (InputError, np.linalg.LinAlgError):
            found.append(None)
    return found


def _difference(whiten: Whitening, expected: Floats, rival: Linearisation) -> Difference:
    change, jacobian = expected - rival.prediction, np.asarray(rival.jacobian)
    return np.asarray(whiten @ change), np.asarray(whiten @ jacobian)


def _effects_of(fits: Iterable[Solution]) -> list[str]:
    """The effects of some fits, sorted."""
    return sorted({name for fit in fits for name in effect_names(fit.case)})


def _with_gear(fit: Solution, option: RunOption) -> Solution:
    """The fit on the gear of a run; coordinates of effects that the gear has not are dropped."""
    if option.gear is None:
        return fit
    case = option.changed(fit.case)
    known = case.parameters()
    kept = [i for i, c in enumerate(fit.coordinates) if c.path in known]
    coordinates = tuple(fit.coordinates[i] for i in kept)
    problem = replace(fit.problem, case=case, coordinates=coordinates)
    return replace(fit, problem=problem, x=fit.x[kept])


def _all_columns(fit: Solution, difference: Difference, changed: Solution) -> Difference:
    """The difference with the Jacobian of all coordinates of a fit: 0 for those dropped."""
    paths = [c.path for c in fit.coordinates]
    jacobian = np.zeros((len(difference[0]), len(paths)))
    jacobian[:, [paths.index(c.path) for c in changed.coordinates]] = difference[1]
    return difference[0], jacobian


def _is_plain_repeat(readings: Readings, y: Floats) -> bool:
    """Whether every explanation predicts for a run what it predicts for the plain run."""
    return len(y) > 1 and not np.any(np.abs(y[0] - y[1]) > SAME_PREDICTION * readings.std)


def _without_equal_rows(runs: Sequence[NextRun]) -> list[NextRun]:
    """The runs, those with equal rows merged to one with both kinds of instruction."""
    merged: dict[object, NextRun] = {}
    for run in runs:
        key = tuple(tuple(row.items()) for row in run.rows) if run.rows else run.kind
        first = merged.get(key)
        merged[key] = replace(first, text=f"{first.text}; or {run.text}") if first else run
    return list(merged.values())


def _static_proposals(
    fits: Mapping[str, Solution], present: Sequence[Difference], effects: Sequence[type[Effect]]
) -> list[NextRun]:
    """Checks of the sensors, and tests of the soil where an explanation concerns the soil."""
    first, *rivals = fits.values()
    proposals = []
    for kind, (text, std_after) in SENSOR_CHECKS.items():
        sigmas = [_check_discrimination(first, rival, std_after) for rival in rivals]
        if max(sigmas) > 0.0:
            proposals.append(NextRun(kind, text, _mean_capped(sigmas), ()))
    if not any(effect.about.kind == "soil" for effect in effects):
        return proposals
    values = {name: fit.values() for name, fit in fits.items()}
    for kind, (text, stds) in SOIL_TESTS.items():
        names = [c.path for c in first.coordinates if c.path in stds]
        if not names:
            continue
        sigmas = [
            _discrimination(rival, old, _soil_difference(first, rival, {k: stds[k] for k in names}))
            for rival, old in zip(rivals, present, strict=True)
        ]
        row: dict[str, float | str] = {
            f"{column(k)} if {name}": v[k] for name, v in values.items() for k in names if k in v
        }
        proposals.append(NextRun(kind, text, _mean_capped(sigmas), (row,)))
    return proposals


def _soil_difference(
    first: Solution, rival: Solution, stds: Mapping[str, tuple[float, bool]]
) -> Difference:
    """Whitened difference of two explanations in the soil parameters that a test determines."""
    own, others = first.values(), rival.values()
    difference, jacobian = np.zeros(len(stds)), np.zeros((len(stds), len(rival.x)))
    rates = rates_at(rival.coordinates, rival.x)
    for i, (name, (std, is_relative)) in enumerate(stds.items()):
        std = std * abs(own[name]) if is_relative else std
        # a parameter that the rival does not free has the value of its case
        there = others[name] if name in others else float(getattr(rival.case.soil, name))
        difference[i] = (own[name] - there) / std
        for j, c in enumerate(rival.coordinates):
            if c.path == name:
                jacobian[i, j] = rates[j] / std
    return difference, jacobian


def _mean_capped(sigmas: Sequence[float]) -> float:
    """Mean discrimination from the rivals, each capped at `MAX_DISCRIMINATION`."""
    return float(np.mean([min(sigma, MAX_DISCRIMINATION) for sigma in sigmas]))


def _discrimination(rival: Solution, present: Difference, new: Difference) -> float:
    """Sigma that new rows add between an explanation and a rival adapted to all rows."""
    increase = _adapted_misfit(rival, [present, new]) - _adapted_misfit(rival, [present])
    return float(np.sqrt(max(increase, 0.0)))


def _adapted_misfit(rival: Solution, parts: Sequence[Difference]) -> float:
    """Squared sigma that remain after the rival has adapted its parameters.

    Priors and tests of the soil are included.
    """
    prior, tests = np.diag([1.0 / c.std for c in rival.coordinates]), rival.soil_tests
    known = -rival.x * np.diag(prior), -tests.deviation(rival.x)
    difference = np.concatenate([*[d for d, _ in parts], *known])
    jacobian = np.vstack([*[j for _, j in parts], prior, tests.rates(rival.x)])
    if not (np.isfinite(difference).all() and np.isfinite(jacobian).all()):
        return float("nan")
    step = np.linalg.lstsq(jacobian, difference, rcond=LEAST_SQUARES_TOLERANCE)[0]
    return float(np.sum((difference - jacobian @ step) ** 2))


def _check_discrimination(first: Solution, rival: Solution, std_after: dict[str, float]) -> float:
    """Sigma by which a check of the sensors would reject one of two explanations."""
    largest = 0.0
    for fit in (first, rival):
        for c, value in zip(fit.coordinates, fit.values().values(), strict=True):
            if c.effect and not c.is_shape and c.effect in std_after:
                largest = max(largest, abs(value) / std_after[c.effect])
    return largest


def _rows(
    readings: Readings, predicted: Mapping[str, Floats], option: RunOption
) -> tuple[dict[str, float | str], ...]:
    """Operating points and gear of a run with the prediction of each explanation."""
    rows = len(readings.run)
    columns: dict[str, Floats] = {
        "slip": np.asarray(readings.at.slip),
        "load_N": np.asarray(readings.at.load),
    }
    for field, key in COVARIATES.items():
        if getattr(readings.at, field) is not None:
            columns[key] = np.broadcast_to(getattr(readings.at, field), (rows,))
    for key, size in (option.gear.columns() if option.gear else {}).items():
        columns[key] = np.full(rows, size)
    for name, y in predicted.items():
        for i, channel in enumerate(readings.channels):
            columns[f"{column(channel)} if {name}"] = y[readings.channel == i]
    found: list[dict[str, float | str]] = []
    for r in range(rows):
        named = {} if readings.at.gear is None else {"gear": str(readings.at.gear[r])}
        found.append(named | {key: float(values[r]) for key, values in columns.items()})
    return tuple(found)
