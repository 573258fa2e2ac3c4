"""Draws of one posterior: soil, effects and the model's error together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.errors import FitError, InputError
from soilml.fitting.candidate_effects import candidate_effects, effect_names
from soilml.fitting.coordinates import Coordinate, select_free, values_at
from soilml.fitting.covariance import USUAL, Whitening
from soilml.fitting.mixtures import with_all_effects
from soilml.fitting.readings import Readings
from soilml.inference.constants import INTERVAL_FACTOR
from soilml.inference.draws import Draws
from soilml.inference.gaussian_terms import FIXED
from soilml.inference.posterior import Posterior, infer
from soilml.inference.problem import InferenceProblem
from soilml.numerics.quantiles import systematic_resampling
from soilml.physics.effects import EFFECTS
from soilml.processes import threads_for
from soilml.quantities import CHANNELS, column
from soilml.remarks import Remark
from soilml.report.numbers import format_probability
from soilml.traction.draws import SoilDraws
from soilml.traction.model_errors import LeftByDraws, span, stated_size

#: Fewest draws of one of several explanations, before they are weighted.
FEWEST = 60
#: Probability that the model lacks an effect from which a remark is made.
NOTABLE = 0.5
MOST_SAID = 3  # Explanations that a remark lists


@dataclass(frozen=True, eq=False)
class PosteriorDraws:
    """Equally weighted draws (n, p) of one or several posteriors of the same readings.

    case: The case with the effects of all draws, whose values are in `soil`.
    left: What the draws of each group leave of the readings, and the sizes of the error.
    remarks: Which effects the draws have beside those of the case, and how often.
    """

    case: Case
    soil: SoilDraws
    readings: Readings
    left: Sequence[LeftByDraws]
    remarks: Sequence[Remark]


def posterior_draws_of(
    case: Case, readings: Readings, free: Sequence[Coordinate], count: int, seed: int = 0
) -> PosteriorDraws:
    """Draws of what a case and readings support.

    A case of several explanations keeps their weights, each with its own soil and sizes; any other
    is weighed against all effects of the catalogue.

    Raises `FitError` where no explanation carries the loads of the rows.
    """
    each = [(1.0, case, dict(candidate_effects(case, EFFECTS)))]
    if case.explanations:
        each = [(e.weight, case.of_explanation(e), {}) for e in case.explanations]
    total, groups = sum(weight for weight, _, _ in each), []
    for weight, own, effects in each:
        problem = InferenceProblem.of(own, readings, _of_case(own, free), effects)
        with threads_for(len(readings)):
            try:
                posterior = infer(problem)
            except InputError as error:
                raise FitError(str(error)) from error
            if posterior.refused is not None:
                continue
            drawn = posterior.draws(seed, max(FEWEST, int(np.ceil(count * weight / total))))
        groups += [(posterior, part, weight / total * part.weight) for part in drawn]
    if not groups:
        raise FitError("no explanation of the model carries the loads of all rows")
    return _equally_weighted(case, groups, count, seed)


def _of_case(case: Case, free: Sequence[Coordinate]) -> list[Coordinate]:
    """The free parameters, and those of the effects of an explanation."""
    known = {c.path for c in free}
    added = [path for path in case.prior if path not in known and "." in path]
    return [
        *select_free(case, [c.path for c in free]),
        *(select_free(case, added) if added else []),
    ]


def _equally_weighted(
    case: Case, groups: Sequence[tuple[Posterior, Draws, Floats]], count: int, seed: int
) -> PosteriorDraws:
    whole = with_all_effects(case, [part.node.fit.case for _, part, _ in groups])
    weights = np.concatenate([weight for _, _, weight in groups])
    offset = np.random.default_rng(seed).random()
    chosen = systematic_resampling(weights / weights.sum(), count, offset)
    first = np.cumsum([0, *(len(weight) for _, _, weight in groups)])
    paths = list(dict.fromkeys(c.path for _, part, _ in groups for c in part.node.fit.coordinates))
    values = np.tile([float(whole.numbers[path]) for path in paths], (count, 1))
    left, shares = [], dict[tuple[str, ...], float]()
    known = effect_names(case)
    for (posterior, part, _), start, end in zip(groups, first, first[1:], strict=False):
        place = np.flatnonzero((chosen >= start) & (chosen < end))
        if not len(place):
            continue
        taken, fit = chosen[place] - start, part.node.fit
        part = _widened(part, [p for _, p, _ in groups if p.node is part.node])
        own = values_at(fit.coordinates, part.x[taken])
        fixed = fit.case.numbers
        for i, path in enumerate(paths):
            if path in fixed:
                values[place, i] = float(fixed[path])
        for i, c in enumerate(fit.coordinates):
            values[place, paths.index(c.path)] = own[:, i]
        sizes, whiten = _sizes(posterior, part), _whiten(posterior, part)
        left.append(LeftByDraws(place, sizes, part.residual[taken], whiten))
        names = tuple(n for n in effect_names(fit.case) if n not in known)
        shares[names] = shares.get(names, 0.0) + len(place) / count
    readings = groups[0][0].terms.readings
    remarks = _remarks(shares, bool(case.explanations))
    return PosteriorDraws(whole, SoilDraws(tuple(paths), values), readings, left, remarks)


def _widened(part: Draws, of_node: Sequence[Draws]) -> Draws:
    """Draws of an explanation with their distances from its mean times `INTERVAL_FACTOR`.

    What they leave of the readings moves with them, to first order, but where a bound ends it.
    """
    x, weight = (np.concatenate([getattr(p, n) for p in of_node]) for n in ("x", "weight"))
    residual = np.concatenate([p.residual for p in of_node])
    share = weight / max(float(weight.sum()), 1e-300)
    middle, left = share @ x, share @ residual
    coordinates = part.node.fit.coordinates
    low, high = (np.asarray([getattr(c, end) for c in coordinates]) for end in ("lower", "upper"))
    return replace(
        part,
        x=np.clip(middle + INTERVAL_FACTOR * (part.x - middle), low, high),
        residual=left + INTERVAL_FACTOR * (part.residual - left),
    )


def _sizes(posterior: Posterior, drawn: Draws) -> dict[str, tuple[float, float]]:
    """Standard deviation of the error of each channel by the drawn hyperparameters."""
    terms, case = posterior.terms, posterior.problem.case
    readings, found = terms.readings, dict[str, tuple[float, float]]()
    amplitude = terms.amplitude(drawn.at) * terms.usual
    for name in CHANNELS:
        if name not in readings.channels:
            usual = case.discrepancy.get(column(name), USUAL)
            found[name] = (usual.amplitude(span(case, readings, name)),) * 2
            continue
        i = readings.channels.index(name)
        size = float(np.hypot(amplitude[i], stated_size(case, readings, name)))
        found[name] = size, max(size, float(terms.usual[i]))
    return found


def _whiten(posterior: Posterior, drawn: Draws) -> Whitening:
    """What whitens noise and shared errors, without what the drawn error has by itself."""
    terms, readings = posterior.terms, posterior.terms.readings
    case = posterior.problem.case
    stated = [i for i, n in enumerate(readings.channels) if stated_size(case, readings, n) > 0.0]
    count = int(np.isin(terms.group, stated).sum())
    kept = np.ones(len(terms.group), bool)  # without what is stated, which is in the functions
    kept[np.flatnonzero(terms.group == FIXED)[:count]] = False
    bare = replace(terms, columns=terms.columns[:, kept], group=terms.group[kept], _kept={})
    return bare.whiten(bare.without_discrepancy(drawn.at), drawn.node.outliers)


def _remarks(shares: Mapping[tuple[str, ...], float], several: bool) -> list[Remark]:
    """That effects are likely which the case lacks, by their shares of the draws."""
    likely = sorted((n for n in shares if n), key=lambda n: -shares[n])
    if 1.0 - shares.get((), 0.0) < NOTABLE:
        return []
    said = [f"{' + '.join(n)} ({format_probability(shares[n])})" for n in likely[:MOST_SAID]]
    if several:
        text = (
            f"the cause of the gap is suspected, not certain: {', '.join(said)}; the bands "
            "include each explanation as likely as it is"
        )
        return [Remark("suspected", text, likely[0])]
    text = (
        f"the model may lack an effect (first suspect: {' + '.join(likely[0])}, probability "
        f"{format_probability(shares[likely[0]])}); the bands include each as likely as it is: "
        "run soilml gap"
    )
    return [Remark("against-model", text, likely[0])]
