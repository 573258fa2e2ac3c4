"""Runs and checks ranked by how well they would separate the explanations that remain."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.errors import InputError
from soilml.fitting.coordinates import rates_at
from soilml.fitting.covariance import Whitening
from soilml.fitting.least_squares import Solution
from soilml.fitting.predictions import Linearisation, linearise
from soilml.fitting.readings import Readings
from soilml.gap.decision import Decision
from soilml.gap.results import NextRun, Suspect
from soilml.gap.run_options import CHECKS, run_options, with_default_covariates
from soilml.inference.explanation import Explanation
from soilml.inference.gaussian_terms import scatter_columns, terms_like
from soilml.inference.posterior import Posterior
from soilml.physics.operating_point import COVARIATES, Operating
from soilml.quantities import QUANTITIES, column
from soilml.report.numbers import LEAST_STATED

#: Sigma at which a discrimination is capped: beyond it, more makes no practical difference.
MAX_DISCRIMINATION = 10.0
#: Sigma below which a run or check is not proposed: six such runs together decide nothing.
MIN_DISCRIMINATION = 0.5
#: Largest difference, in sigma of a reading, of two predictions that count as equal.
SAME_PREDICTION = 0.1
#: Explanations that are compared: suspects, or members of a class; and proposals that are listed.
RIVALS, COMPARED, LISTED = 3, 5, 8

#: Whitened difference (m,) of two explanations on some rows, and the rival's Jacobian (m, p).
Difference = tuple[Floats, Floats]
#: Columns of the rows of a run or check, by name.
Rows = tuple[dict[str, float | str], ...]


#: Kind, text and rows of a run or check, and how each rival differs on them from the first.
_Proposal = tuple[str, str, Rows, Sequence[Difference]]


def competing_explanations(
    posterior: Posterior, decision: Decision, listed: Sequence[Suspect]
) -> list[Explanation]:
    """The explanations to distinguish, the first one from the others: those that a report lists.

    They are those of a class; else the named one, or the first suspect, and the suspects after it
    whose probability is stated. Where there is none, the rival is the soil alone.
    """
    sets = list(decision.claimed)
    if len(sets) < 2:
        stated = [s.effects for i, s in enumerate(listed) if i < 2 or s.probability >= LEAST_STATED]
        sets = list(dict.fromkeys([*decision.listed[:1], *stated]))[:RIVALS]
    nodes = [node for names in sets if (node := posterior.node_of(names)) is not None]
    return nodes if len(nodes) > 1 else [*nodes, posterior.soil]


def next_runs(posterior: Posterior, explanations: Sequence[Explanation]) -> list[NextRun]:
    """Runs and checks ranked by how well they discriminate the first explanation from the others.

    The discrimination is the expected increase, in sigma, of the misfit of a rival that adapts all
    its parameters to the present and the new rows together. With fewer than two explanations there
    is nothing to discriminate.
    """
    compared = explanations[:COMPARED]
    if len(compared) < 2:
        return []
    fits = {"+".join(node.hypothesis.effects) or "soil alone": node.fit for node in compared}
    first, *rivals = fits.values()
    present = [
        _difference(posterior.whiten, first.linearisation, rival.linearisation) for rival in rivals
    ]
    sets = tuple(dict.fromkeys(node.hypothesis.effects for node in compared))
    found = []
    for kind, text, rows, differences in (*_runs(posterior, fits), *_checks(fits)):
        try:
            increases = [
                _adapted_misfit(rival, [old, new]) - _adapted_misfit(rival, [old])
                for rival, old, new in zip(rivals, present, differences, strict=True)
            ]
        except np.linalg.LinAlgError:
            continue
        sigmas = np.sqrt(np.maximum(increases, 0.0))
        size = float(np.mean(np.minimum(sigmas, MAX_DISCRIMINATION)))
        if size >= MIN_DISCRIMINATION:  # that of a rival without an equilibrium is NaN
            found.append(NextRun(kind, text, size, rows, sets))
    return sorted(found, key=lambda run: -run.discrimination)[:LISTED]


def _runs(posterior: Posterior, fits: Mapping[str, Solution]) -> Iterator[_Proposal]:
    """Runs that no explanation refuses, and that one at least tells from a plain repeat."""
    like, first = posterior.terms.readings, next(iter(fits.values()))
    for option in run_options(like, first.fitted()):
        try:
            here = [_linearised(option.at, fit, like.channels) for fit in fits.values()]
            readings = _readings_like(option.at, first.case, like, here[0].prediction)
            if (usual := option.plain) is not None:
                plain = (_linearised(usual, fit, like.channels) for fit in fits.values())
                pairs = zip(here, plain, strict=True)
                changes = (np.abs(a.prediction - b.prediction) / readings.std for a, b in pairs)
                if all((change <= SAME_PREDICTION).all() for change in changes):
                    continue
            columns = scatter_columns(first.fitted(), readings)
            terms, at = terms_like(posterior.terms, posterior.noise, readings, columns)
            whiten = terms.whiten(at, np.zeros(len(readings), bool))
        except (InputError, np.linalg.LinAlgError):
            continue
        differences = [_difference(whiten, here[0], line) for line in here[1:]]
        predicted = {name: line.prediction for name, line in zip(fits, here, strict=True)}
        yield option.kind, option.text, _rows_of_run(readings, predicted), differences


def _linearised(at: Operating, fit: Solution, channels: Sequence[str]) -> Linearisation:
    """The predictions of a fit for a run, with usual covariates where its effects need some."""
    readings = Readings.of_every_row(with_default_covariates(at, fit.case), channels)
    return linearise(fit.case, fit.coordinates, fit.x, readings)


def _readings_like(at: Operating, case: Case, like: Readings, measured: Floats) -> Readings:
    """Measured values (m,) of a run, with the noise of known readings, else that of the case."""
    stds = []
    for i, own in enumerate(np.split(measured, len(like.channels))):
        noise = case.noise.get(column(like.channels[i]))
        typical = np.full(own.shape, np.median(like.std[like.channel == i]))
        stds.append(np.maximum(typical if noise is None else noise.std(own), 1e-12))
    return replace(
        Readings.of_every_row(with_default_covariates(at, case), like.channels),
        measured=measured,
        std=np.concatenate(stds),
        runs=("next",),
    )


def _rows_of_run(readings: Readings, predicted: Mapping[str, Floats]) -> Rows:
    """Operating points and gear of a run with the prediction of each explanation."""
    at, count = readings.at, len(readings.run)
    columns: dict[str, Any] = {"gear": at.gear, "slip": at.slip, "load_N": at.load}
    columns |= {key: getattr(at, field) for field, key in COVARIATES.items()}
    for name, y in predicted.items():
        for i, channel in enumerate(readings.channels):
            columns[f"{column(channel)} if {name}"] = y[readings.channel == i]
    known = {k: np.broadcast_to(v, count).tolist() for k, v in columns.items() if v is not None}
    return tuple(
        dict(zip(known, values, strict=True)) for values in zip(*known.values(), strict=True)
    )


def _difference(whiten: Whitening, first: Linearisation, rival: Linearisation) -> Difference:
    change = first.prediction - rival.prediction
    return np.asarray(whiten @ change), np.asarray(whiten @ rival.jacobian)


def _checks(fits: Mapping[str, Solution]) -> Iterator[_Proposal]:
    """Checks of sensors and tests of the soil that measure what some explanation frees."""
    first, *rivals = fits.values()
    values = {name: fit.values() for name, fit in fits.items()}
    for kind, (text, stds) in CHECKS.items():
        free = {path: std for path, std in stds.items() if any(path in v for v in values.values())}
        if free:
            row: dict[str, float | str] = {
                f"{column(path) if path in QUANTITIES else path} if {name}": own[path]
                for name, own in values.items()
                for path in free
                if path in own
            }
            differences = [_difference_of_parameters(first, rival, free) for rival in rivals]
            yield kind, text, (row,), differences


def _difference_of_parameters(
    first: Solution, rival: Solution, stds: Mapping[str, float | str]
) -> Difference:
    """Whitened difference of two explanations in the parameters that a check measures.

    An effect that an explanation lacks has the size zero in it.
    """
    difference, jacobian = np.zeros(len(stds)), np.zeros((len(stds), len(rival.x)))
    rates = rates_at(rival.coordinates, rival.x)
    for i, (path, given) in enumerate(stds.items()):
        own, other = (_value(fit, path) for fit in (first, rival))
        share = float(given.removesuffix(" %")) / 100.0 if isinstance(given, str) else 0.0
        std = share * abs(own) if isinstance(given, str) else given
        difference[i] = (own - other) / std
        jacobian[i] = np.where([c.path == path for c in rival.coordinates], rates / std, 0.0)
    return difference, jacobian


def _value(fit: Solution, path: str) -> float:
    """The value of a parameter in an explanation; zero for the size of an effect it has not."""
    known = fit.case.parameters()
    fixed = float(known[path][1]) if path in known else 0.0
    return fit.values().get(path, fixed)


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
    step = np.linalg.lstsq(jacobian, difference, rcond=1e-10)[0]
    return float(np.sum((difference - jacobian @ step) ** 2))
