"""Entries of a report that come from the analysis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from soilml.arrays import Floats
from soilml.fitting.effect_signatures import effect_signatures
from soilml.fitting.least_squares import Solution
from soilml.fitting.predictions import predict
from soilml.gap.checks import ONE_LOAD
from soilml.gap.evidence.covariance import FEW_RUNS
from soilml.gap.evidence.linearised_fit import AMPLITUDES
from soilml.gap.evidence.marginal_likelihood import Evidence
from soilml.gap.evidence.problem import FitProblem, MarginalFit
from soilml.gap.evidence.repeats import overstated_noise_notes
from soilml.gap.evidence.score_test import SignatureSimilarity
from soilml.gap.report.listed_explanations import SUSPECTS_IN_LINE
from soilml.gap.report.results import (
    CandidateSummary,
    NamedEffect,
    ReadingsAndPredictions,
    Suspect,
)
from soilml.gap.report.sentences import outliers_in_words
from soilml.gap.search.explanation import Explanation
from soilml.gap.search.passes import Analysis
from soilml.gap.search.posterior import REJECTION_THRESHOLD, Posterior
from soilml.gap.search.prediction import PredictiveGain, predictive_gains
from soilml.gap.verdict.decision import implausible_sizes
from soilml.gap.verdict.estimates import effect_estimates
from soilml.gap.verdict.fit_notes import (
    beyond_priors_notes,
    bound_notes,
    large_noise_notes,
    size_notes,
)
from soilml.identification.fit import disagreeing_soil_tests
from soilml.quantities import column
from soilml.remarks import Remark, texts
from soilml.report.numbers import LEAST_STATED, format_log_density

LISTED_OUTLIERS = 6  # Outliers that a note lists by name
LISTED_SUSPECTS = 8  # Suspects that are listed
#: Share of the probability of effects from which a stated set with others takes their place.
SAME_SUSPECT = 0.9
NOTABLE_NOISE_SCALE = 1.25  # Factor on the declared noise above which a note is made


def soil_marginal(analysis: Analysis) -> MarginalFit:
    """The soil alone under noise and scatter, without any discrepancy."""
    soil = analysis.result.soil
    no_discrepancy = np.zeros(len(analysis.problem.readings.channels))
    return MarginalFit(
        soil, Evidence(soil.objective, no_discrepancy, np.zeros(len(soil.x)), no_discrepancy)
    )


def soil_beside_discrepancy(analysis: Analysis) -> MarginalFit:
    """The soil alone beside a smooth discrepancy, which model.toml has where nothing is claimed.

    At the largest amplitude that is tried, a discrepancy of any size is cheap, and the soil would
    go wherever the rest looks smoothest; it then stays where noise and scatter alone put it, as it
    does where no gap was found.
    """
    problem, soil_alone = analysis.problem, analysis.result.soil_alone
    if soil_alone is None:
        return MarginalFit(analysis.result.soil, problem.discrepancy.evidence(analysis.result.soil))
    if not soil_alone.amplitude.any():
        return soil_marginal(analysis)
    if soil_alone.amplitude.max() < AMPLITUDES[-1]:
        return soil_alone.best
    soil = analysis.result.soil
    return MarginalFit(soil, problem.discrepancy.evidence(soil, soil_alone.amplitude))


#: Codes of the verdicts on candidates, where a cause is claimed and where none is, in words.
_VERDICTS = {
    "not-converged": ("fit did not converge: no evidence",) * 2,
    "best": ("explains the data", "fits best, not claimed"),
    "not-rejected": ("more effects than needed", "not rejected, not claimed"),
    "rejected": ("rejected against the best",) * 2,
}


def candidate_summaries(analysis: Analysis, *, claimed: bool) -> list[CandidateSummary]:
    """All fitted candidates, the best first; `claimed`: whether the report claims a cause."""
    result = analysis.result
    if result.soil_alone is None:
        return []
    lowest = min((c.objective for c in result.candidates if c.names), default=0.0)
    accepted = {c.names for c in result.accepted}
    summaries = []
    for c in result.candidates:
        if not c.names:
            continue
        if c.names in accepted:
            code = "best"
        elif not c.catalogue_law.fit.converged:
            code = "not-converged"
        elif c.objective <= lowest + REJECTION_THRESHOLD:
            code = "not-rejected"
        else:
            code = "rejected"
        single = len(c.names) == 1
        summaries.append(
            CandidateSummary(
                effects=c.names,
                predicted_gain=result.predicted_gain.get(c.names[0], 0.0) if single else np.nan,
                achieved_gain=result.soil_alone.objective - c.objective,
                excess=c.objective - lowest,
                verdict=Remark(code, _VERDICTS[code][0 if claimed else 1], c.names, "note"),
            )
        )
    return summaries


def suspects(analysis: Analysis, claimed: Sequence[Explanation]) -> list[Suspect]:
    """Explanations with their odds against all others, the likeliest first.

    The first one is that whose figures are shown; see `Posterior.from_first`. After it come those
    only whose odds the data raise, and after one of an implausible size those whose probability is
    stated. A set that adds effects to a claimed one is listed as that one, since the evidence for
    what it adds is not decisive.
    """
    problem, posterior = analysis.problem, analysis.result.posterior
    stated = [c.names for c in claimed]

    def as_claimed(names: tuple[str, ...]) -> tuple[str, ...]:
        return next((own for own in stated if set(own) <= set(names)), names)

    def is_part(names: tuple[str, ...]) -> bool:
        """Whether a stated set contains these effects, which hardly occur without the others."""
        least = SAME_SUSPECT * posterior.probability(*names)
        larger = [own for own in stated if set(names) < set(own)]
        return any(posterior.probability(*own) > least for own in larger)

    listed = dict.fromkeys([*stated, *(as_claimed(names) for names, _ in posterior.ranked())])
    listed = dict.fromkeys(names for names in listed if not is_part(names))
    ranked = sorted(((n, posterior.log_odds(*n)) for n in listed), key=lambda item: -item[1])
    ranked = posterior.from_first(ranked, {c.names: c.penalty for c in analysis.result.candidates})
    rest = [own for own in ranked[1:] if posterior.favours(own[0], problem.penalty(own[0]))]
    if ranked and ranked[0][0] in posterior.oversized and posterior.is_stated(ranked[0][0]):
        rest = [own for own in rest if posterior.is_stated(own[0])]
    gains, oversized = predictive_gains(analysis.predictions), posterior.oversized
    sizes = {
        c.names: implausible_sizes(c.fit)
        for c in analysis.result.candidates
        if c.names in oversized
    }
    return [
        Suspect(
            names,
            odds,
            posterior.probability(*names),
            *_gain(gains.get(names)),
            times_usual=sizes.get(names, {}),
        )
        for names, odds in [*ranked[:1], *rest[: LISTED_SUSPECTS - 1]]
    ]


def _gain(gain: PredictiveGain | None) -> tuple[float | None, float | None]:
    """A predictive gain and its standard error as entries of a report."""
    return (None, None) if gain is None else (gain.value, gain.std_error)


def prediction_notes(
    names: Sequence[str], analysis: Analysis, not_reduced: Sequence[Remark]
) -> list[Remark]:
    """A note on effects that the model contains because they predict, or else on figures.

    not_reduced: Figures that do not shrink without a remainder, which that note contains.
    """
    if not names:
        return list(not_reduced)
    gain = predictive_gains(analysis.predictions)[tuple(names)]
    how = "better" if gain.is_clearly_better else "no worse"
    text = (
        f"model.toml contains {' + '.join(names)}, which is suspected and not named. Beside a "
        f"smooth remainder, it predicts rows kept back {how} than the soil alone does "
        f"(ln density {format_log_density(gain.value, gain.std_error)})"
    )
    if not_reduced:
        each = [f"{figure[:1].upper()}{figure[1:]}" for figure in texts(not_reduced)]
        text = ". ".join([text, "Without a remainder it does not", *each])
    return [Remark("suspect-predicts", text, tuple(names), "note")]


def conditions_of_suspects(
    analysis: Analysis, naming_obstacles: Sequence[Remark]
) -> tuple[Remark, ...]:
    """The conditions under which the odds of suspects are valid."""
    text = "no other cause than those of the catalogue has a similar signature"
    conditions = [Remark("catalogue-complete", text)]
    if len(analysis.problem.readings.runs) == 1:
        conditions.append(Remark("one-bed", "the bed was the same for all rows"))
    if any(obstacle.code == ONE_LOAD for obstacle in naming_obstacles):
        text = "the soil parameters lie inside their priors, because one load cannot test them"
        conditions.append(Remark("inside-priors", text))
    return tuple(conditions)


def competing_explanations(analysis: Analysis, claimed: Sequence[Explanation]) -> list[Explanation]:
    """The explanations to distinguish, the first one from the others: those that a report lists.

    They are those of a class; else a named one, or the first suspect, and the suspects after it
    whose probability is stated. Where there is none, the next suspect, or else the next of the
    fitted ones, is the rival. A suspect that was not fitted predicts nothing, and is left out.

    claimed: The explanations that the verdict states.
    """
    result = analysis.result
    if len(claimed) > 1:
        return list(claimed)
    fitted = {c.names: c for c in (*result.candidates, *claimed) if c.names}
    listed = [s for s in suspects(analysis, claimed) if s.effects in fitted]
    first = [c.names for c in claimed] or [s.effects for s in listed[:1]]
    stated = [s.effects for s in listed if s.probability >= LEAST_STATED][:SUSPECTS_IN_LINE]
    ordered = list(dict.fromkeys([*first, *stated, *(s.effects for s in listed), *fitted]))
    rivals = [names for names in ordered[1:] if not set(ordered[0]) < set(names)]
    count = max(1, sum(names in stated for names in rivals))
    return [fitted[names] for names in [*ordered[:1], *rivals[:count]]]


def analysis_notes(
    analysis: Analysis,
    written: Solution,
    listed: Sequence[Solution],
    replicates: Sequence[Remark],
) -> list[Remark]:
    """Notes on outliers, estimates at a bound, sizes, repeats, noise and run-to-run variation.

    `written` is the fit that model.toml contains, `listed` those of the explanations that are shown
    or suspected; `replicates` says which repeats disagree.
    """
    readings = analysis.problem.readings
    components = analysis.problem.covariance.components
    notes = []
    if count := len(analysis.outliers):
        names = ", ".join(analysis.outliers[:LISTED_OUTLIERS])
        text = f"{outliers_in_words(count)} excluded: {names}"
        notes.append(Remark("outliers", text, analysis.outliers))
    soil = analysis.result.soil
    far = disagreeing_soil_tests(soil.case, soil.values()) if analysis.result.has_gap else []
    notes += [
        Remark(
            "soil-test",
            f"with the soil alone, the rows disagree with a test of the soil: {text}; part of the "
            "gap lies there, unless the test was made on another soil",
        )
        for text in far
    ]
    if analysis.within_priors is not None:
        notes += beyond_priors_notes(analysis.within_priors.case.prior, written)
    notes += bound_notes(written.coordinates, written.x.tolist())
    notes += dict.fromkeys(n for fit in listed for n in size_notes(fit.coordinates, fit.x.tolist()))
    for name, scale in zip(readings.channels, components.noise_scale, strict=True):
        if scale > NOTABLE_NOISE_SCALE:
            text = (
                f"residuals of {column(name)} about the likeliest explanation, beside smooth "
                f"functions, are {scale:.2g} times the declared noise: noise, or a law that "
                "changes fast with slip"
            )
            notes.append(Remark("noise-scaled", text, (column(name),)))
    known = overstated_noise_notes(readings)
    said = {note.about for note in known}
    large = large_noise_notes(analysis.problem, analysis.result.soil)
    notes += [*known, *(note for note in large if note.about not in said)]
    notes += [replace(r, text=f"replicate rows disagree: {r}") for r in replicates]
    if 1 < len(readings.runs) < FEW_RUNS:
        text = (
            f"run-to-run variation of the soil cannot be estimated from fewer than {FEW_RUNS} "
            f"runs. Assumed are {np.degrees(components.friction_angle_std):.2g} deg of friction "
            f"angle and {100.0 * components.bearing_std:.2g} % of bearing strength, so mean "
            "squared residuals may be below 1"
        )
        notes.append(Remark("few-runs", text, severity="note"))
    if components.autocorrelation > 0.0:
        text = (
            "the noise of neighbouring samples of a run is correlated "
            f"({components.autocorrelation:.2g}), which reduces their weight"
        )
        notes.append(Remark("autocorrelated", text, severity="note"))
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
        "friction_angle_std": components.friction_angle_std,
        "bearing_std": components.bearing_std,
        "autocorrelation": components.autocorrelation,
    }


def readings_and_predictions(analysis: Analysis, shown: Solution) -> ReadingsAndPredictions:
    """Readings, predictions by the soil alone and by the fit `shown`, and standard deviations."""
    problem, readings = analysis.problem, analysis.problem.readings
    jacobian = shown.derivatives
    variance = np.einsum("ij,jk,ik->i", jacobian, shown.covariance, jacobian)
    after = predict(shown.case, shown.coordinates, shown.x[None, :], readings)[0]
    return ReadingsAndPredictions(
        channels=tuple(column(n) for n in readings.channels),
        channel=readings.channel,
        run=tuple(readings.runs[readings.run[r]] for r in readings.row),
        slip=readings.slip,
        load=readings.load,
        measured=readings.measured,
        std=problem.covariance.std,
        before=analysis.result.soil.prediction,
        after=after,
        after_std=np.sqrt(np.maximum(variance, 0.0)),
    )


def named_effects(
    accepted: Sequence[Explanation],
    fit: Solution,
    similarity: SignatureSimilarity,
    posterior: Posterior,
) -> list[NamedEffect]:
    """The effects of the best candidate, with the effects of the other accepted candidates.

    `fit` is that of the best candidate, with its intervals.
    """
    best = accepted[0]
    alternatives = {n for c in accepted[1:] for n in c.names} - set(best.names)
    effects = []
    for name in best.names:
        snr, rival = similarity.separation(name, _size(best.fit, name))
        effects.append(
            NamedEffect(
                name=name,
                parameters=effect_estimates(fit, name),
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


def signature_similarity(
    problem: FitProblem, fit: Solution, amplitude: Floats
) -> SignatureSimilarity:
    """Similarity of the catalogue's signatures beside a discrepancy, on the soil of a fit.

    `amplitude` is that of the remaining discrepancy by channel, in usual ones.
    """
    whiten = problem.discrepancy.whiten(amplitude)
    values = fit.values()
    soil = {c.path: values[c.path] for c in fit.coordinates if (not c.effect)}
    case = problem.case.with_values(soil)
    signatures, _ = effect_signatures(case, problem.readings, problem.effects)
    columns = whiten @ np.stack([s.column for s in signatures], axis=1)
    space = whiten @ fit.derivatives[:, : len(problem.soil)]
    return SignatureSimilarity.beside(space, [s.name for s in signatures], columns)
