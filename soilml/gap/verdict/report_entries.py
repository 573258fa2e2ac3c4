"""Entries of a report that come from the analysis: one function for each."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from soilml.fitting.coordinates import (
    Coordinate,
    EffectCoordinate,
    SoilCoordinate,
    predict_readings,
)
from soilml.fitting.least_squares import Solution
from soilml.fitting.soil_test_remarks import disagreeing_soil_tests
from soilml.gap.report_parts import (
    CandidateSummary,
    GapReduction,
    ReadingsAndPredictions,
    Suspect,
)
from soilml.gap.search.candidate_fits import CandidateFit
from soilml.gap.search.iteration import Analysis
from soilml.gap.search.marginal_fits import MarginalFit
from soilml.gap.search.posterior import REJECTION_THRESHOLD
from soilml.gap.statistics.amplitude_prior import AMPLITUDES
from soilml.gap.statistics.evidence import LARGEST_SIZE, Evidence
from soilml.gap.statistics.reml_covariance import FEW_RUNS
from soilml.gap.statistics.repeats import overstated_noise_notes
from soilml.gap.verdict.cross_validation import gap_reduction, held_out
from soilml.quantities import column
from soilml.report.numbers import format_quantity

#: Outliers that a note lists by name.
LISTED_OUTLIERS = 6
#: Suspects that are listed.
LISTED_SUSPECTS = 8
#: Distance from a bound, as a fraction of the range, at which an estimate counts as at the bound.
AT_BOUND = 1e-3
#: Factor on the declared noise above which a note is made.
NOTABLE_NOISE_SCALE = 1.25


def gap_reductions(
    analysis: Analysis, soil: MarginalFit, after: MarginalFit, seed: int
) -> dict[str, GapReduction]:
    """Figures of the fitted rows and of cross-validation, as far as the runs allow it.

    Before is the soil alone, fitted under noise and scatter; after is the explanation shown.
    """
    problem = analysis.problem
    std = problem.covariance.std
    before, new = soil.fit.prediction, after.fit.prediction
    fitted = gap_reduction(problem.readings, std, before, new, "all rows fitted")
    return {"train": fitted, **held_out(problem, soil, after, seed)}


def soil_marginal(analysis: Analysis) -> MarginalFit:
    """The soil alone under noise and scatter, without any discrepancy."""
    soil = analysis.result.soil
    none = np.zeros(len(analysis.problem.readings.channels))
    return MarginalFit(soil, Evidence(soil.objective, none, np.zeros(len(soil.x)), none))


def soil_beside_discrepancy(analysis: Analysis) -> MarginalFit:
    """The soil alone beside a smooth discrepancy, which model.toml has where nothing is claimed.

    At the largest amplitude that is tried, a discrepancy of any size is cheap, and the soil would
    go wherever the rest looks smoothest; it then stays where noise and scatter alone put it, as it
    does where no gap was found.
    """
    problem, none = analysis.problem, analysis.result.none
    if none is None:
        return MarginalFit(analysis.result.soil, problem.discrepancy.evidence(analysis.result.soil))
    if not none.amplitude.any():
        return soil_marginal(analysis)
    if none.amplitude.max() < AMPLITUDES[-1]:
        return none.best
    soil = analysis.result.soil
    return MarginalFit(soil, problem.discrepancy.evidence(soil, none.amplitude))


def candidate_summaries(analysis: Analysis, *, claimed: bool) -> list[CandidateSummary]:
    """All fitted candidates, the best first; `claimed`: whether the report claims a cause."""
    result = analysis.result
    if result.none is None:
        return []
    lowest = min((c.objective for c in result.candidates if c.names), default=0.0)
    accepted = {c.names for c in result.accepted}
    summaries = []
    for c in result.candidates:
        if not c.names:
            continue
        single = len(c.names) == 1
        predicted = result.predicted_gain.get(c.names[0], 0.0) if single else float("nan")
        if c.names in accepted:
            verdict = "explains the data" if claimed else "fits best, not claimed"
        elif not c.catalogue_law.fit.converged:
            verdict = "fit did not converge: no evidence"
        elif c.objective <= lowest + REJECTION_THRESHOLD:
            verdict = "more effects than needed" if claimed else "not rejected, not claimed"
        else:
            verdict = "rejected against the best"
        achieved = result.none.objective - c.objective
        excess = c.objective - lowest
        summaries.append(CandidateSummary(c.names, predicted, achieved, excess, verdict))
    return summaries


def suspects(analysis: Analysis, naming_obstacles: Sequence[str]) -> list[Suspect]:
    """Explanations with their odds against all others, the likeliest first.

    The odds hold under the conditions that `given` states in words.
    """
    conditions = ["no other cause than those of the catalogue has a similar signature"]
    if len(analysis.problem.readings.runs) == 1:
        conditions.append("the bed was the same for all rows")
    if any("load" in text for text in naming_obstacles):
        conditions.append(
            "the soil parameters lie inside their priors, because one load cannot test them"
        )
    given = "if " + ", and if ".join(conditions)
    return [
        Suspect(names, odds, given)
        for names, odds in analysis.result.posterior.ranked()[:LISTED_SUSPECTS]
    ]


def competing_explanations(analysis: Analysis) -> list[CandidateFit]:
    """The explanations to distinguish: those not rejected, or the best one and its runner-up."""
    accepted = [c for c in analysis.result.accepted if c.names]
    others = [c for c in analysis.result.candidates if c.names and c not in accepted]
    if len(accepted) > 1:
        return accepted
    rivals = [c for c in others if not accepted or not set(accepted[0].names) < set(c.names)]
    return [*accepted, *rivals][:2] if accepted else rivals[:3]


def analysis_notes(
    analysis: Analysis, after: Solution, shown: Solution, alike: Sequence[str]
) -> list[str]:
    """Notes on outliers, estimates at a bound, sizes, repeats, noise and run-to-run variation.

    `after` is the fit that model.toml contains, `shown` that of the explanation whose figures are
    shown; `alike` says which repeats disagree.
    """
    readings = analysis.problem.readings
    components = analysis.problem.covariance.components
    notes = []
    if analysis.outliers:
        listed = ", ".join(analysis.outliers[:LISTED_OUTLIERS])
        count = len(analysis.outliers)
        many = (
            f"{count} readings are outliers and were"
            if count > 1
            else "1 reading is an outlier and was"
        )
        notes.append(f"{many} excluded: {listed}")
    soil = analysis.result.soil
    far = disagreeing_soil_tests(soil.case, soil.values()) if analysis.result.has_gap else []
    notes += [
        f"with the soil alone, the rows disagree with a test of the soil: {text}; part of the gap "
        "lies there, unless the test was made on another soil"
        for text in far
    ]
    notes += _bound_notes(after.coordinates, after.x.tolist())
    notes += size_notes(shown.coordinates, shown.x.tolist())
    for name, scale in zip(readings.channels, components.noise_scale, strict=True):
        if scale > NOTABLE_NOISE_SCALE:
            notes.append(f"the noise of {column(name)} is {scale:.2g} times as large as declared")
    notes += overstated_noise_notes(readings)
    notes += [f"rows driven alike disagree: {text}" for text in alike]
    if 1 < len(readings.runs) < FEW_RUNS:
        notes.append(
            f"run-to-run variation of the soil cannot be estimated from fewer than {FEW_RUNS} "
            f"runs: {np.degrees(components.friction_angle_std):.2g} deg of friction angle and "
            f"{components.bearing_std:.0%} of bearing strength are assumed, so mean squared "
            "residuals may be below 1"
        )
    if components.autocorrelation > 0.0:
        notes.append(
            "the noise of neighbouring samples of a run is correlated "
            f"({components.autocorrelation:.2g}), which reduces their weight"
        )
    return notes


def _bound_notes(coordinates: Sequence[Coordinate], x: Sequence[float]) -> list[str]:
    notes = []
    for c, value in zip(coordinates, x, strict=True):
        if isinstance(c, SoilCoordinate):
            if min(value, 1.0 - value) < AT_BOUND:
                notes.append(f"{c.path} is at a bound of its prior")
        elif value > c.upper - AT_BOUND * (c.upper - c.lower):
            notes.append(f"{c.path} is at its upper bound")
    return notes


def size_notes(coordinates: Sequence[Coordinate], x: Sequence[float]) -> list[str]:
    """Notes on effects that would have to be far larger than they usually are."""
    notes = []
    for c, size in zip(coordinates, x, strict=True):
        if isinstance(c, EffectCoordinate) and not c.is_shape and abs(size) > LARGEST_SIZE:
            value, usual = c.prior.at(np.asarray([size, 1.0]))
            notes.append(
                f"{c.name} of {c.effect} would have to be {format_quantity(value, c.unit)}, "
                f"{abs(size):.3g} times its usual size ({format_quantity(usual, c.unit)}): the law "
                "of the catalogue does not explain the gap by an effect of plausible size"
            )
    return notes


def variance_component_entries(analysis: Analysis) -> dict[str, float]:
    """The variance components by their names in gap.json."""
    channels = analysis.problem.readings.channels
    components = analysis.problem.covariance.components
    scales = {
        f"noise_scale_{column(name)}": float(scale)
        for name, scale in zip(channels, components.noise_scale, strict=True)
    }
    return scales | {
        "friction_angle_from_run_to_run_rad": components.friction_angle_std,
        "bearing_from_run_to_run": components.bearing_std,
        "memory_of_samples": components.autocorrelation,
    }


def readings_and_predictions(analysis: Analysis, after: Solution) -> ReadingsAndPredictions:
    """Readings, predictions before and after, and the standard deviations of both."""
    problem, readings = analysis.problem, analysis.problem.readings
    jacobian = after.derivatives
    variance = np.einsum("ij,jk,ik->i", jacobian, after.covariance, jacobian)
    prediction = predict_readings(after.case, after.coordinates, after.x[None, :], readings)[0]
    return ReadingsAndPredictions(
        channels=tuple(column(n) for n in readings.channels),
        channel=readings.channel,
        run=tuple(readings.runs[readings.run[r]] for r in readings.row),
        slip=readings.slip,
        load=readings.load,
        reading=readings.reading,
        std=problem.covariance.std,
        before=analysis.result.soil.prediction,
        after=prediction,
        after_std=np.sqrt(np.maximum(variance, 0.0)),
        held_out=np.zeros(len(readings), dtype=np.bool_),
    )
