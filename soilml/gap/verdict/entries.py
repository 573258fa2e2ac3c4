"""Entries of a report that come from the posterior."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from soilml.fitting.effect_signatures import effect_signatures
from soilml.fitting.fitted_readings import FittedReadings
from soilml.fitting.least_squares import Solution
from soilml.gap.checks import ONE_LOAD
from soilml.gap.evidence.repeats import overstated_noise_notes
from soilml.gap.evidence.similarity import SignatureSimilarity
from soilml.gap.report.listed_explanations import SUSPECTS_IN_LINE
from soilml.gap.report.results import (
    CandidateSummary,
    NamedEffect,
    Suspect,
)
from soilml.gap.report.sentences import outliers_in_words
from soilml.gap.verdict.decision import Decision
from soilml.gap.verdict.estimates import effect_estimates
from soilml.gap.verdict.fit_notes import (
    beyond_priors_notes,
    bound_notes,
    large_noise_notes,
    size_notes,
)
from soilml.identification.fit import disagreeing_soil_tests
from soilml.inference.constants import NEAR, SCATTER_UNITS
from soilml.inference.explanation import Explanation
from soilml.inference.posterior import Posterior
from soilml.quantities import column
from soilml.remarks import Remark
from soilml.report.numbers import LEAST_STATED

LISTED_OUTLIERS = 6  # Outliers that a note lists by name
NOTABLE_NOISE_SCALE = 1.25  # Factor on the declared noise above which a note is made
#: With fewer runs than this the run-to-run variation is known from its prior more than from them.
FEW_RUNS = 6

#: Verdicts on candidates, where a cause is claimed and where none is, in words.
_VERDICTS = {
    "best": ("explains the data", "fits best, not claimed"),
    "not-rejected": ("not rejected", "not rejected, not claimed"),
    "rejected": ("rejected against the best",) * 2,
}


def candidate_summaries(posterior: Posterior, decision: Decision) -> list[CandidateSummary]:
    """The fitted sets of effects, the likeliest first, each with its likeliest law and soil."""
    nodes = list({n.hypothesis.effects: n for n in posterior.nodes[::-1]}.values())[::-1]
    nodes.sort(key=lambda node: node.value)
    alone = min(n.value for n in nodes if not n.hypothesis.effects)
    lowest = min((n.value for n in nodes if n.hypothesis.effects), default=0.0)
    summaries = []
    for node in nodes:
        names = node.hypothesis.effects
        if not names:
            continue
        code = "not-rejected" if node.value < lowest + NEAR else "rejected"
        if names in decision.listed[:1]:
            code = "best"
        predicted = posterior.search.predicted.get(node.hypothesis)
        summaries.append(
            CandidateSummary(
                effects=names,
                predicted_gain=np.nan if predicted is None else alone - predicted.value,
                achieved_gain=alone - node.value,
                excess=node.value - lowest,
                verdict=Remark(code, _VERDICTS[code][0 if decision.claimed else 1], names, "note"),
            )
        )
    return summaries


def conditions_of_suspects(
    posterior: Posterior, naming_obstacles: Sequence[Remark]
) -> tuple[Remark, ...]:
    """The conditions under which the odds of suspects are valid."""
    text = "no other cause than those of the catalogue has a similar signature"
    conditions = [Remark("catalogue-complete", text)]
    if len(posterior.terms.readings.runs) == 1:
        conditions.append(Remark("one-bed", "the bed was the same for all rows"))
    if any(obstacle.code == ONE_LOAD for obstacle in naming_obstacles):
        text = "the soil parameters lie inside their priors, because one load cannot test them"
        conditions.append(Remark("inside-priors", text))
    return tuple(conditions)


def competing_explanations(
    posterior: Posterior, decision: Decision, listed: Sequence[Suspect]
) -> list[Explanation]:
    """The explanations to distinguish, the first one from the others: those that a report lists.

    They are those of a class; else the named one, or the first suspect, and the suspects after it
    whose probability is stated. Where there is none, the next suspect is the rival, or the soil
    alone.
    """
    if len(decision.claimed) > 1:
        ordered = list(decision.claimed)
        count = len(ordered) - 1
    else:
        stated = [s.effects for s in listed if s.probability >= LEAST_STATED]
        ordered = list(dict.fromkeys([*decision.listed[:1], *(s.effects for s in listed)]))
        count = max(1, sum(names in stated[:SUSPECTS_IN_LINE] for names in ordered[1:]))
    if not ordered:
        return []
    rivals = [names for names in ordered[1:] if not set(ordered[0]) < set(names)]
    nodes = [posterior.node_of(names) for names in [*ordered[:1], *rivals[:count]]]
    found = [node for node in nodes if node is not None]
    return found if len(found) > 1 else [*found, posterior.soil]


def analysis_notes(
    posterior: Posterior,
    alone: Solution,
    written: Explanation,
    listed: Sequence[Explanation],
    place: Callable[[int], str],
) -> list[Remark]:
    """Notes on outliers, estimates at a bound, sizes, noise and run-to-run variation.

    alone: The soil alone, fitted under noise and scatter.
    written: What model.toml contains.
    listed: The explanations that are shown or suspected.
    place: The file and line of a row.
    """
    readings, terms = posterior.terms.readings, posterior.terms
    notes = []
    if names := outlier_names(posterior, place):
        text = f"{outliers_in_words(len(names))} excluded: {', '.join(names[:LISTED_OUTLIERS])}"
        notes.append(Remark("outliers", text, names))
    gap = posterior.no_gap < 0.5
    far = disagreeing_soil_tests(alone.case, alone.values()) if gap else []
    notes += [
        Remark(
            "soil-test",
            f"with the soil alone, the rows disagree with a test of the soil: {text}; part of the "
            "gap lies there, unless the test was made on another soil",
        )
        for text in far
    ]
    if written.hypothesis.wide_priors:
        notes += beyond_priors_notes(posterior.problem.case.prior, written.fit)
    notes += bound_notes(written.fit.coordinates, written.fit.x.tolist())
    sized = [n for node in listed for n in size_notes(node.fit.coordinates, node.fit.x.tolist())]
    notes += dict.fromkeys(sized)
    for name, scale in zip(readings.channels, terms.noise_scale(posterior.noise), strict=True):
        if scale > NOTABLE_NOISE_SCALE:
            text = (
                f"residuals of {column(name)} about the likeliest explanation, beside smooth "
                f"functions, are {scale:.2g} times the declared noise: noise, or a law that "
                "changes fast with slip"
            )
            notes.append(Remark("noise-scaled", text, (column(name),)))
    known = overstated_noise_notes(readings)
    said = {note.about for note in known}
    large = large_noise_notes(posterior, alone)
    notes += [*known, *(note for note in large if note.about not in said)]
    if 1 < len(readings.runs) < FEW_RUNS:
        found = variance_component_entries(posterior)
        text = (
            f"run-to-run variation of the soil is poorly known from fewer than {FEW_RUNS} runs. "
            f"Assumed are {np.degrees(found['friction_angle_std']):.2g} deg of friction angle and "
            f"{100.0 * found['bearing_std']:.2g} % of bearing strength, so mean squared residuals "
            "may be below 1"
        )
        notes.append(Remark("few-runs", text, severity="note"))
    if (rho := posterior.noise.autocorrelation) > 0.0:
        text = (
            "the noise of neighbouring samples of a run is correlated "
            f"({rho:.2g}), which reduces their weight"
        )
        notes.append(Remark("autocorrelated", text, severity="note"))
    return notes


def outlier_names(posterior: Posterior, place: Callable[[int], str]) -> tuple[str, ...]:
    """The readings that stray, by channel and place."""
    readings = posterior.terms.readings
    return tuple(
        f"{column(readings.channels[readings.channel[i]])} at {place(int(readings.row[i]))}"
        for i in np.flatnonzero(posterior.outliers)
    )


def variance_component_entries(posterior: Posterior) -> dict[str, float]:
    """Noise scales, scatter and autocorrelation of the likeliest hypothesis, by their names."""
    terms, at = posterior.terms, posterior.noise
    scales = {
        f"noise_scale_{column(name)}": float(scale)
        for name, scale in zip(terms.readings.channels, terms.noise_scale(at), strict=True)
    }
    angle, bearing = terms.scatter(at)
    return scales | {
        "friction_angle_std": float(angle * SCATTER_UNITS["friction_angle"]),
        "bearing_std": float(bearing * SCATTER_UNITS["bearing"]),
        "autocorrelation": at.autocorrelation,
    }


def readings_and_predictions(
    posterior: Posterior, before: Solution, after: Solution
) -> FittedReadings:
    """Readings, predictions by the soil alone and by the fit shown, and standard deviations."""
    readings, jacobian = posterior.terms.readings, after.derivatives
    variance = np.einsum("ij,jk,ik->i", jacobian, after.covariance, jacobian)
    return FittedReadings(
        channels=tuple(column(n) for n in readings.channels),
        channel=readings.channel,
        run=tuple(readings.runs[readings.run[r]] for r in readings.row),
        slip=readings.slip,
        load=readings.load,
        measured=readings.measured,
        std=posterior.std,
        before=before.prediction,
        after=after.prediction,
        after_std=np.sqrt(np.maximum(variance, 0.0)),
    )


def named_effects(
    posterior: Posterior, decision: Decision, similarity: SignatureSimilarity
) -> list[NamedEffect]:
    """The effects of the first claimed set, with those of the other ones."""
    node, best = decision.shown, decision.claimed[0]
    assert node is not None
    alternatives = {n for names in decision.claimed[1:] for n in names} - set(best)
    effects = []
    for name in best:
        snr, rival = similarity.separation(name, _size(node.fit, name))
        effects.append(
            NamedEffect(
                name=name,
                parameters=effect_estimates(node, name),
                alternatives=tuple(sorted(alternatives)),
                separating_snr=snr,
                nearest_rival=rival,
                probability=posterior.probability(name),
                log_odds=posterior.log_odds(name),
            )
        )
    return effects


def _size(fit: Solution, effect: str) -> float:
    """Size of an effect in reference sizes; its coordinate precedes those of its shape."""
    for c, x in zip(fit.coordinates, fit.x, strict=True):
        if c.effect and c.effect == effect:
            return float(x)
    return 0.0


def signature_similarity(posterior: Posterior, node: Explanation) -> SignatureSimilarity:
    """Similarity of the catalogue's signatures beside the discrepancy of a node, on its soil."""
    problem, readings = posterior.problem, posterior.terms.readings
    whiten = posterior.terms.whiten(node.at, node.outliers)
    values = node.fit.values()
    soil = [i for i, c in enumerate(node.fit.coordinates) if not c.effect]
    paths = [node.fit.coordinates[i].path for i in soil]
    case = problem.case.with_values({path: values[path] for path in paths})
    signatures, _ = effect_signatures(case, readings, problem.effects)
    columns = np.asarray(whiten @ np.stack([s.column for s in signatures], axis=1))
    space = np.asarray(whiten @ node.fit.derivatives[:, soil])
    return SignatureSimilarity.beside(space, [s.name for s in signatures], columns)


def repeat_notes(replicates: Sequence[Remark]) -> list[Remark]:
    """Notes on replicate rows that disagree."""
    return [replace(r, text=f"replicate rows disagree: {r}") for r in replicates]
