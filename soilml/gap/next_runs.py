"""Runs and checks ranked by how well they would discriminate between explanations."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from soilml.arrays import Floats
from soilml.errors import InputError
from soilml.fitting.candidate_effects import effect_names
from soilml.fitting.coordinates import rates_at
from soilml.fitting.covariance import Whitening
from soilml.fitting.least_squares import Solution
from soilml.fitting.predictions import (
    Linearisation,
    linearise,
    predict,
)
from soilml.fitting.readings import Readings
from soilml.gap.decision import Decision
from soilml.gap.planned_readings import readings_like, with_default_covariates
from soilml.gap.results import NextRun, Suspect
from soilml.gap.run_options import SENSOR_CHECKS, SOIL_TESTS, RunOption, run_options
from soilml.gap.sentences import SUSPECTS_IN_LINE
from soilml.inference.explanation import Explanation
from soilml.inference.gaussian_terms import scatter_columns, terms_like
from soilml.inference.posterior import Posterior
from soilml.physics.operating_point import COVARIATES, Operating
from soilml.quantities import column
from soilml.report.numbers import LEAST_STATED

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


def competing_explanations(
    posterior: Posterior, decision: Decision, listed: Sequence[Suspect]
) -> list[Explanation]:
    """The explanations to distinguish, the first one from the others: those that a report lists.

    They are those of a class; else the named one, or the first suspect, and the suspects after it
    whose probability is stated. Where there is none, the next suspect is the rival, or the soil
    alone.
    """
    ordered, count = list(decision.claimed), len(decision.claimed) - 1
    if count < 1:
        stated = [s.effects for s in listed if s.probability >= LEAST_STATED][:SUSPECTS_IN_LINE]
        ordered = list(dict.fromkeys([*decision.listed[:1], *(s.effects for s in listed)]))
        count = max(1, sum(names in stated for names in ordered[1:]))
    if not ordered:
        return []
    rivals = [names for names in ordered[1:] if not set(ordered[0]) < set(names)]
    nodes = [posterior.node_of(names) for names in [*ordered[:1], *rivals[:count]]]
    found = [node for node in nodes if node is not None]
    return found if len(found) > 1 else [*found, posterior.soil]


def next_runs(posterior: Posterior, explanations: Sequence[Explanation]) -> list[NextRun]:
    """Runs and checks ranked by how well they discriminate the first explanation from the others.

    The discrimination is the expected increase, in sigma, of the misfit of a rival that adapts all
    its parameters to the present and the new rows together. With fewer than two explanations there
    is nothing to discriminate. A run for which every explanation predicts what it predicts for a
    plain repeat is left out.
    """
    compared = explanations[:COMPARED]
    if len(compared) < 2:
        return []
    readings = posterior.terms.readings
    fits = {"+".join(node.hypothesis.effects) or "soil alone": node.fit for node in compared}
    first, *rivals = fits.values()
    effects = sorted({name for fit in fits.values() for name in effect_names(fit.case)})
    white, expected = posterior.whiten, first.prediction
    present = [_difference(white, expected, rival.linearisation) for rival in rivals]
    options = run_options(readings, first.fitted(), effects)
    proposals = []
    for run, new in _differences(posterior, list(_expected(readings, fits, options))):
        _, *others = run.fits.values()
        try:
            sigmas = [
                _discrimination(rival, old, _all_columns(rival, added, other))
                for rival, other, old, added in zip(rivals, others, present, new, strict=True)
            ]
        except np.linalg.LinAlgError:
            continue
        if np.isfinite(sigmas).all():
            size, option = _mean_capped(sigmas), run.option
            proposals.append(NextRun(option.kind, option.text, size, run.rows()))
    for kind, (text, std_after) in SENSOR_CHECKS.items():
        sigmas = [_check_discrimination(first, rival, std_after) for rival in rivals]
        proposals.append(NextRun(kind, text, _mean_capped(sigmas), ()))
    known = posterior.problem.effects
    if any(name in known and known[name].about.kind == "soil" for name in effects):
        proposals += _soil_tests(fits, present)
    sets = tuple(dict.fromkeys(node.hypothesis.effects for node in compared))
    useful = [
        replace(run, compared=sets) for run in proposals if run.discrimination >= MIN_DISCRIMINATION
    ]
    return sorted(useful, key=lambda run: -run.discrimination)


@dataclass(frozen=True)
class _ExpectedRun:
    """A run, the explanations on its gear, and what these predict, (fits, m)."""

    option: RunOption
    fits: Mapping[str, Solution]
    readings: Readings
    predicted: Floats

    def rows(self) -> tuple[dict[str, float | str], ...]:
        """Operating points and gear of the run with the prediction of each explanation."""
        at, count = self.readings.at, len(self.readings.run)
        columns: dict[str, Any] = {"slip": at.slip, "load_N": at.load}
        columns |= {key: getattr(at, field) for field, key in COVARIATES.items()}
        columns |= {"grouser_height_m": 0.0 if self.option.smooth else None}
        for name, y in zip(self.fits, self.predicted, strict=True):
            for i, channel in enumerate(self.readings.channels):
                columns[f"{column(channel)} if {name}"] = y[self.readings.channel == i]
        known = {k: np.broadcast_to(v, count) for k, v in columns.items() if v is not None}
        found: list[dict[str, float | str]] = []
        for r in range(count):
            named = {} if at.gear is None else {"gear": str(at.gear[r])}
            found.append(named | {key: float(values[r]) for key, values in known.items()})
        return tuple(found)


def _expected(
    like: Readings, fits: Mapping[str, Solution], options: Iterable[RunOption]
) -> Iterator[_ExpectedRun]:
    """What the explanations predict for runs; those that they refuse, and repeats, are left out."""

    def predicted(at: Operating, fit: Solution) -> Floats:
        rows = Readings.of_every_row(with_default_covariates(at, fit.case), like.channels)
        return np.asarray(predict(fit.case, fit.coordinates, fit.x[None, :], rows)[0])

    for option in options:
        changed = {name: _with_gear(fit, option) for name, fit in fits.items()}
        ways = [option.at] if option.plain is None else [option.at, option.plain]
        try:
            y = np.asarray([[predicted(at, fit) for fit in changed.values()] for at in ways])
        except InputError:
            continue
        case = next(iter(changed.values())).case
        readings = readings_like(option.at, like, case, y[0, 0], option.kind)
        if len(y) == 1 or np.any(np.abs(y[0] - y[1]) > SAME_PREDICTION * readings.std):
            yield _ExpectedRun(option, changed, readings, y[0])


def _differences(
    posterior: Posterior, runs: Sequence[_ExpectedRun]
) -> Iterator[tuple[_ExpectedRun, list[Difference]]]:
    """How the first explanation differs from the others in each run that none of them refuses."""

    def linearised(run: _ExpectedRun, fit: Solution) -> Linearisation:
        rows = replace(run.readings, at=with_default_covariates(run.readings.at, fit.case))
        return linearise(fit.case, fit.coordinates, fit.x, rows)

    for run in runs:
        one, *others = run.fits.values()
        try:
            own = [linearised(run, fit) for fit in others]
            columns = scatter_columns(one.fitted(), run.readings)
            terms, at = terms_like(posterior.terms, posterior.noise, run.readings, columns)
            whiten = terms.whiten(at, np.zeros(len(run.readings), bool))
            yield run, [_difference(whiten, run.predicted[0], line) for line in own]
        except (InputError, np.linalg.LinAlgError):
            continue


def _difference(whiten: Whitening, expected: Floats, rival: Linearisation) -> Difference:
    change, jacobian = expected - rival.prediction, np.asarray(rival.jacobian)
    return np.asarray(whiten @ change), np.asarray(whiten @ jacobian)


def _with_gear(fit: Solution, option: RunOption) -> Solution:
    """The fit on the gear of a run; coordinates of effects that the gear has not are dropped."""
    case = option.changed(fit.case)
    if case is fit.case:
        return fit
    known = case.parameters()
    kept = [i for i, c in enumerate(fit.coordinates) if c.path in known]
    coordinates = tuple(fit.coordinates[i] for i in kept)
    return replace(
        fit, problem=replace(fit.problem, case=case, coordinates=coordinates), x=fit.x[kept]
    )


def _all_columns(fit: Solution, difference: Difference, changed: Solution) -> Difference:
    """The difference with the Jacobian of all coordinates of a fit: 0 for those dropped."""
    paths = [c.path for c in fit.coordinates]
    jacobian = np.zeros((len(difference[0]), len(paths)))
    jacobian[:, [paths.index(c.path) for c in changed.coordinates]] = difference[1]
    return difference[0], jacobian


def _soil_tests(fits: Mapping[str, Solution], present: Sequence[Difference]) -> Iterator[NextRun]:
    """Tests of the soil, of parameters that the explanations free."""
    first, *rivals = fits.values()
    values = {name: fit.values() for name, fit in fits.items()}
    for kind, (text, stds) in SOIL_TESTS.items():
        names = [c.path for c in first.coordinates if c.path in stds]
        if names:
            own = {k: stds[k] for k in names}
            sigmas = [
                _discrimination(rival, old, _soil_difference(first, rival, own))
                for rival, old in zip(rivals, present, strict=True)
            ]
            row: dict[str, float | str] = {
                f"{column(k)} if {n}": v[k] for n, v in values.items() for k in names if k in v
            }
            yield NextRun(kind, text, _mean_capped(sigmas), (row,))


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
        jacobian[i] = [
            rate / std if c.path == name else 0.0
            for c, rate in zip(rival.coordinates, rates, strict=True)
        ]
    return difference, jacobian


def _mean_capped(sigmas: Sequence[float]) -> float:
    """Mean discrimination from the rivals, each capped at `MAX_DISCRIMINATION`."""
    return float(np.mean(np.minimum(sigmas, MAX_DISCRIMINATION)))


def _discrimination(rival: Solution, present: Difference, new: Difference) -> float:
    """Sigma that new rows add between an explanation and a rival adapted to all rows."""
    increase = _adapted_misfit(rival, [present, new]) - _adapted_misfit(rival, [present])
    return float(np.sqrt(np.maximum(increase, 0.0)))


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
    sizes = [
        abs(value) / std_after[c.effect]
        for fit in (first, rival)
        for c, value in zip(fit.coordinates, fit.values().values(), strict=True)
        if c.effect in std_after and not c.is_shape
    ]
    return max(sizes, default=0.0)
