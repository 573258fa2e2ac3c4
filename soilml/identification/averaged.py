"""The soil averaged over explanations of the rows, each weighted by its evidence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.fitting.candidate_effects import candidate_effects
from soilml.fitting.coordinates import Coordinate
from soilml.fitting.effect_signatures import effect_signatures
from soilml.fitting.misfit import fit_under_declared_noise, misfit_limit
from soilml.fitting.readings import Readings
from soilml.fitting.uncarried_loads import raise_uncarried
from soilml.identification.fit import SoilExplanation
from soilml.identification.hypotheses import ErrorHypothesis, fit_hypothesis
from soilml.identification.posterior import PosteriorSamples
from soilml.identification.soil_density import SoilDensity
from soilml.numerics.importance_sampling import ImportanceSample
from soilml.physics.effects import EFFECTS
from soilml.physics.effects.base import Effect

#: Probability that model and sensors are as in the model file, but for declared errors: a model is
#: never quite right.
EXACT = 0.06
#: Probabilities of errors of all kinds together, by their scale over the typical ones.
ERRORS = {0.1: 0.14, 0.25: 0.14, 0.5: 0.16, 1.0: 0.2, 2.0: 0.02}
#: Probability that one effect of the catalogue is missing, by the scale of errors beside it, and
#: the standard deviations of its size, in reference sizes, each as likely.
EFFECT, SIZES = {0.0: 0.1, 0.25: 0.1}, (1.0, 3.0)
#: Probability that a law of the soil is a little different, by one of these effects, and the
#: standard deviation of its size, in reference sizes. Rows hardly tell the laws of a family apart,
#: and the soil differs by them.
LAW, LAW_SIZE = 0.08, 0.4
LAWS = ("shear-softening", "hyperbolic-shear", "curved-envelope")
#: Power of the evidence: Laplace's approximation, and errors that are not all as described,
#: overstate its differences.
TEMPERING = 0.5
MOST_EFFECTS = 4  # Most effects that are fitted beside errors of one scale
#: Ratio to the largest weight below which an explanation is not fitted, or not sampled.
LEAST_WEIGHT = 0.01


@dataclass(frozen=True)
class AveragedSamples(PosteriorSamples):
    """Samples of the soil by all explanations, the likeliest explanation first."""

    explanations: tuple[SoilExplanation, ...] = ()


def averaged_samples(
    case: Case,
    readings: Readings,
    free: Sequence[Coordinate],
    effects: Mapping[str, type[Effect]] = EFFECTS,
) -> AveragedSamples:
    r"""Weighted samples of the soil over all explanations of the rows.

    .. math:: p(\theta | y) = \sum_h p(h | y)\, p(\theta | y, h), \quad
        p(h | y) \propto p(h) \left[\int p(y | \theta, h)\, p(\theta)\, d\theta\right]^{1/2}

    The explanations are the model as it is (`EXACT`), errors of sensors and model of several scales
    with a smooth discrepancy (`ERRORS`), and an effect of the catalogue beside small errors
    (`EFFECT`). Effects are screened by their linearised evidence; those in reach of the best are
    fitted. Where residuals exceed even the likeliest explanation significantly, noise and errors
    are multiplied by the root of the misfit.

    Parameters
    ----------
    case
        Model, soil, priors and noise; a [discrepancy] that it states is in all explanations.
    readings
        Rows; noise that is not declared is that of the residuals of the exact model.
    free
        The p free parameters.
    effects
        The catalogue of effects by name.

    Raises `FitError` where no parameters in the prior carry the measured loads.

    References
    ----------
    Hoeting, Madigan, Raftery and Volinsky, Statist. Sci. 14(4), 1999 (model averaging). MacKay,
    Neural Computation 4(3), 1992 (evidence by Laplace's approximation).
    """
    readings, start = with_noise_of_fit(case, readings, free)
    effects = candidate_effects(case, effects)
    found = _fitted(case, readings, free, effects, start)
    if not found:
        raise_uncarried(case, readings.at)
    likeliest = max(found, key=_log_weight)[1]
    freedom = readings.reading_count - len(free)
    misfit = (likeliest.squares + readings.squares_within) / max(freedom, 1)
    scale = 1.0
    if misfit > misfit_limit(freedom):
        scale = float(np.sqrt(misfit))
        found = [(h, replace(density, noise_scale=scale)) for h, density in found]
    return _mixture(found, misfit, scale)


def with_noise_of_fit(
    case: Case, readings: Readings, free: Sequence[Coordinate]
) -> tuple[Readings, dict[str, float]]:
    """Readings with the noise of the exact model's residuals where none is declared; its values.

    Raises `FitError` where no parameters in the prior carry the measured loads.
    """
    weighted, optimum = fit_under_declared_noise(case, readings, free)
    if readings.undeclared:
        known = np.isfinite(readings.std)
        std = np.where(known, readings.std, weighted.readings.std)
        readings = replace(readings, std=std, from_case=readings.from_case & known)
    return readings, optimum.values()


def _log_weight(entry: tuple[ErrorHypothesis, SoilDensity]) -> float:
    return float(np.log(entry[0].prior)) + TEMPERING * entry[1].log_evidence


def _fitted(
    case: Case,
    readings: Readings,
    free: Sequence[Coordinate],
    effects: Mapping[str, type[Effect]],
    start: Mapping[str, float],
) -> list[tuple[ErrorHypothesis, SoilDensity]]:
    """The hypotheses that can be fitted, with their densities."""
    found: list[tuple[ErrorHypothesis, SoilDensity]] = []

    def fit(hypothesis: ErrorHypothesis, start: Mapping[str, float]) -> SoilDensity | None:
        density = fit_hypothesis(hypothesis, case, readings, free, effects, start)
        if density is None or not np.isfinite(density.log_evidence):
            return None
        found.append((hypothesis, density))
        return density

    bases = {}
    for scale, prior in {0.0: EXACT, **ERRORS}.items():
        density = fit(ErrorHypothesis(prior, scale), start)
        if density is not None:
            start, bases[scale] = density.optimum.values(), density
    likeliest = max((_log_weight(entry) for entry in found), default=-np.inf)
    for scale, prior in EFFECT.items():
        if scale in bases:
            least = likeliest + np.log(LEAST_WEIGHT)
            for hypothesis, own in _promising(bases[scale], scale, prior, effects, least):
                fit(hypothesis, own)
    return found


def _promising(
    base: SoilDensity,
    scale: float,
    prior: float,
    effects: Mapping[str, type[Effect]],
    least: float,
) -> list[tuple[ErrorHypothesis, dict[str, float]]]:
    """Effects beside `base` whose expected logarithm of the weight is the largest, above `least`.

    With the values from which they are fitted.
    """
    optimum, rated = base.optimum, []
    signatures, _ = effect_signatures(optimum.fitted(), optimum.problem.readings, effects)
    for signature in signatures:
        about = effects[signature.name].about
        sizes = dict.fromkeys(SIZES, prior / (len(signatures) * len(SIZES)))
        if signature.name in LAWS and scale == 0.0:
            sizes[LAW_SIZE] = LAW / len(LAWS)
        for size, own in sizes.items():
            gain, expected = base.gain(signature.column, size, signature.sign)
            path = f"{signature.name}.{about.size}"
            start = optimum.values() | {path: expected * about.reference[about.size]}
            hypothesis = ErrorHypothesis(own, scale, signature.name, size)
            log = float(np.log(own)) + TEMPERING * (gain + base.log_evidence)
            rated.append((log, hypothesis, start))
    rated.sort(key=lambda entry: -entry[0])
    return [(hypothesis, start) for log, hypothesis, start in rated[:MOST_EFFECTS] if log > least]


def _mixture(
    found: Sequence[tuple[ErrorHypothesis, SoilDensity]], misfit: float, scale: float
) -> AveragedSamples:
    """Samples of all hypotheses by their weights; unlikely ones are left out."""
    weights = _normalised([_log_weight(entry) for entry in found])
    kept = [entry for entry, w in zip(found, weights, strict=True) if w >= LEAST_WEIGHT]
    samples = [density.sample() for _, density in kept]
    logs = [
        float(np.log(h.prior)) + TEMPERING * own.evidence
        for (h, _), own in zip(kept, samples, strict=True)
    ]
    weights = _normalised(logs)
    sample = ImportanceSample(
        np.concatenate([own.u for own in samples]),
        np.concatenate([w * own.weights for w, own in zip(weights, samples, strict=True)]),
        float(np.logaddexp.reduce(logs)),
    )
    shares: dict[tuple[str, float], float] = {}
    for (h, _), w in zip(kept, weights, strict=True):  # two sizes of one effect are one statement
        shares[h.effect, h.scale] = shares.get((h.effect, h.scale), 0.0) + float(w)
    stated = sorted((SoilExplanation(*of, w) for of, w in shares.items()), key=_improbability)
    return AveragedSamples(sample, misfit, scale, tuple(stated))


def _improbability(one: SoilExplanation) -> float:
    return -one.probability


def _normalised(logs: Sequence[float]) -> Floats:
    weights = np.exp(np.asarray(logs) - max(logs))
    return np.asarray(weights / weights.sum())


@dataclass(frozen=True)
class StatedExplanation:
    """Explanations that differ in the size of errors alone, which are one statement.

    Attributes
    ----------
    effect
        Name of the effect of the catalogue that the model lacks; "" for none.
    error_scales
        Sizes of all errors of sensors and model over the typical ones, rising.
    probability
        The sum of their shares in the averaged answer.
    """

    effect: str
    error_scales: tuple[float, ...]
    probability: float

    def __str__(self) -> str:
        """What it says, in words."""
        low, high = self.error_scales[0], self.error_scales[-1]
        if low == high:
            return str(SoilExplanation(self.effect, low, self.probability))
        errors = f"typical errors x {low:g} to {high:g}"
        return f"{self.effect} and {errors}" if self.effect else errors


def stated_explanations(explanations: Sequence[SoilExplanation]) -> list[StatedExplanation]:
    """The explanations with their shares summed over the sizes of errors, the likeliest first."""
    together: dict[tuple[str, bool], list[SoilExplanation]] = {}
    for one in explanations:
        together.setdefault((one.effect, one.exact), []).append(one)
    stated = [
        StatedExplanation(
            effect,
            tuple(sorted(one.error_scale for one in own)),
            sum(one.probability for one in own),
        )
        for (effect, _), own in together.items()
    ]
    return sorted(stated, key=lambda one: -one.probability)
