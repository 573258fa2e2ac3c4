"""Equally weighted draws of soil, effects and the error of the model: of priors, and of rows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.config.explanations import one_of
from soilml.errors import FitError, InputError
from soilml.fitting.candidate_effects import candidate_effects, effect_names
from soilml.fitting.coordinates import Coordinate, select_free, values_at
from soilml.fitting.covariance import USUAL, Whitening
from soilml.fitting.misfit import excess_residuals_remark
from soilml.fitting.mixtures import with_all_effects
from soilml.fitting.predictions import predict
from soilml.fitting.readings import Readings
from soilml.fitting.usable_readings import usable_readings
from soilml.identification.posterior import check_declared, posterior_samples, prior_fractions
from soilml.inference.constants import INTERVAL_FACTOR
from soilml.inference.draws import Draws
from soilml.inference.gaussian_terms import FIXED
from soilml.inference.posterior import Posterior, infer
from soilml.inference.problem import InferenceProblem
from soilml.io.table import Table
from soilml.numerics.quantiles import systematic_resampling
from soilml.physics.effects import EFFECTS
from soilml.processes import threads_for
from soilml.quantities import CHANNELS, column
from soilml.remarks import Remark
from soilml.report.numbers import format_probability
from soilml.traction.draws import SoilDraws
from soilml.traction.model_errors import LeftByDraws, drawn_errors, learned, span, stated_size

#: Where the soil of rows is drawn without a remainder that was learned from them.
DRAWN_WITHOUT = Remark(
    "same-rows",
    "[remainder] was learned from rows of this table, which would count twice: it is left out, and "
    "drawn anew from the rows",
    severity="note",
)
#: Fewest draws of one of several explanations, before they are weighted.
FEWEST = 60
#: Probability that the model lacks an effect from which a remark is made.
NOTABLE = 0.5
MOST_SAID = 3  # Explanations that a remark lists
#: Number of draws: the probability below a 5 % quantile of as many has a standard error of 1.1 %.
DRAWS = 400


def prior_draws(
    free: Sequence[Coordinate], count: int = DRAWS, case: Case | None = None
) -> SoilDraws:
    """Draws of the priors by Latin hypercube; tests of the case's soil take part."""
    return _soil_draws(free, prior_fractions(free, count, np.random.default_rng(0), case))


def mixed_prior_draws(case: Case, count: int) -> tuple[Case, SoilDraws]:
    """Draws of the priors of all explanations by their weights, and the case that has them all."""
    each = [case.of_explanation(one) for one in case.explanations]
    weights = np.asarray([one.weight for one in case.explanations])
    place = systematic_resampling(weights / weights.sum(), count, 0.5)
    whole = with_all_effects(case, each)
    paths = list(dict.fromkeys(path for own in each for path in own.numbers))
    paths = [path for path in paths if not path.startswith(("gear.", "gears."))]
    values = np.tile([float(whole.numbers[path]) for path in paths], (count, 1))
    for i, own in enumerate(each):
        rows = np.flatnonzero(place == i)
        known = {
            path: np.asarray(float(own.numbers[path])) for path in paths if path in own.numbers
        }
        if len(rows) and own.prior:
            drawn = prior_draws(select_free(own, None), len(rows), own)
            known |= {path: drawn.values[:, k] for k, path in enumerate(drawn.names)}
        for path, value in known.items():
            values[rows, paths.index(path)] = value
    return whole, SoilDraws(tuple(paths), values)


def _soil_draws(free: Sequence[Coordinate], u: Floats) -> SoilDraws:
    values = np.stack([f.prior.at(u[:, i]) for i, f in enumerate(free)], axis=1)
    return SoilDraws(tuple(f.path for f in free), values)


@dataclass(frozen=True, eq=False)
class MeasuredSoil:
    """What predicts on the soil of measured rows.

    case: The case whose parameters the draws give; of several explanations, with all their effects.
    draws: Draws of these parameters.
    unknown: The parameters that were unknown.
    readings: What was measured, beyond whose range errors fade.
    left: What the draws leave of the readings.
    spread: Factor on the standard deviations of errors given the readings.
    """

    case: Case
    draws: SoilDraws
    unknown: Sequence[Coordinate]
    warnings: tuple[Remark, ...]
    readings: Readings
    left: Sequence[LeftByDraws]
    spread: float = 1.0

    def with_errors(
        self, slip: Floats, load: Sequence[float], channels: Sequence[str]
    ) -> tuple[SoilDraws, SoilDraws]:
        """Draws given the rows, and of the prior, with the errors of these channels.

        slip, load: Slips and loads (N) at which errors are asked for.
        """
        found = drawn_errors(self.case, self.readings, self.left, slip, load, channels, self.spread)
        after, before = found or (None, None)
        prior = prior_draws(self.unknown, case=self.case)
        return replace(self.draws, errors=after), replace(prior, errors=before)


def measured_soil(
    case: Case,
    table: Table,
    free: Sequence[str] | None = None,
    exact_model: bool = False,
) -> MeasuredSoil:
    """The soil of the rows of a table; raises as `pull_report` does.

    With `exact_model`, model and sensors are exactly as the case has them. Else draws are of one
    posterior over effects, soil and smooth error; what was learned from these rows is left out.
    """
    if exact_model:
        return _exact_soil(case, table, free)
    learned_before, case = case.remainder, case.without_learned_discrepancy()
    case = case.without_remainder_of(table)
    unknown = select_free(case, free)
    readings = usable_readings(case, table).thinned()
    check_declared(readings)
    warnings = [*([DRAWN_WITHOUT] if case.remainder is not learned_before else []), *readings.notes]
    if readings.channels == ("torque",):
        text = "torque alone hardly reveals errors of the model: measure pull or sinkage too"
        warnings.append(Remark("torque-alone", text, ("torque_Nm",)))
    return _equally_weighted(case, _posteriors(case, readings, unknown), unknown, warnings)


def _exact_soil(case: Case, table: Table, free: Sequence[str] | None) -> MeasuredSoil:
    """The soil with model and sensors exactly as the case has them."""
    case = one_of(case, "the case")
    unknown, readings = select_free(case, free), usable_readings(case, table).thinned()
    check_declared(readings)
    samples = posterior_samples(case, readings, unknown)
    x = samples.sample.u[samples.equally_weighted(DRAWS)]
    warnings = [*readings.notes]
    if samples.rejected:
        consequence = "bands are widened and may be biased"
        warnings.append(excess_residuals_remark(samples.noise_scale, case, consequence))
    residual = np.nan_to_num(readings.measured - predict(case, unknown, x, readings))
    none = np.zeros((len(readings), 0))
    left = LeftByDraws(
        np.arange(DRAWS), _stated_sizes(case, readings), residual,
        Whitening(1.0 / readings.std, none, np.zeros(0)),
    )  # fmt: skip
    draws = _soil_draws(unknown, x)
    return MeasuredSoil(
        case, draws, unknown, tuple(warnings), readings, [left], samples.noise_scale
    )


def _stated_sizes(case: Case, readings: Readings) -> dict[str, tuple[float, float]]:
    """Sizes of the stated errors; those of a [remainder] are in its functions."""
    sizes = {
        name: 1.0 if learned(case, name) else stated_size(case, readings, name) for name in CHANNELS
    }
    return {name: (size, size) for name, size in sizes.items() if size > 0.0}


def _posteriors(
    case: Case, readings: Readings, free: Sequence[Coordinate]
) -> list[tuple[Posterior, Draws, Floats]]:
    """Draws of what a case and readings support, with their weights.

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
            drawn = posterior.draws(0, max(FEWEST, int(np.ceil(DRAWS * weight / total))))
        groups += [(posterior, part, weight / total * part.weight) for part in drawn]
    if not groups:
        raise FitError("no explanation of the model carries the loads of all rows")
    return groups


def _of_case(case: Case, free: Sequence[Coordinate]) -> list[Coordinate]:
    """The free parameters, and those of the effects of an explanation."""
    known = {c.path for c in free}
    added = [path for path in case.prior if path not in known and "." in path]
    return [
        *select_free(case, [c.path for c in free]),
        *(select_free(case, added) if added else []),
    ]


def _equally_weighted(
    case: Case,
    groups: Sequence[tuple[Posterior, Draws, Floats]],
    unknown: Sequence[Coordinate],
    warnings: Sequence[Remark],
) -> MeasuredSoil:
    """Equally weighted draws of all groups, with remarks on the effects that they have."""
    whole = with_all_effects(case, [part.node.fit.case for _, part, _ in groups])
    weights = np.concatenate([weight for _, _, weight in groups])
    offset = np.random.default_rng(0).random()
    chosen = systematic_resampling(weights / weights.sum(), DRAWS, offset)
    first = np.cumsum([0, *(len(weight) for _, _, weight in groups)])
    stated = {path: float(value) for path, value in whole.numbers.items()}
    fits = [part.node.fit for _, part, _ in groups]
    drawn = [c.path for fit in fits for c in fit.coordinates]
    fixed = [p for fit in fits for p, v in fit.case.numbers.items() if stated.get(p, v) != v]
    paths = list(dict.fromkeys([*drawn, *fixed]))
    values = np.tile([stated[path] for path in paths], (DRAWS, 1))
    left, shares = [], dict[tuple[str, ...], float]()
    known = effect_names(case)
    for (posterior, part, _), start, end in zip(groups, first, first[1:], strict=False):
        place = np.flatnonzero((chosen >= start) & (chosen < end))
        if not len(place):
            continue
        taken, fit = chosen[place] - start, part.node.fit
        part = _widened(part, [p for _, p, _ in groups if p.node is part.node])
        own = values_at(fit.coordinates, part.x[taken])
        numbers = fit.case.numbers
        for i, path in enumerate(paths):
            if path in numbers:
                values[place, i] = float(numbers[path])
        for i, c in enumerate(fit.coordinates):
            values[place, paths.index(c.path)] = own[:, i]
        sizes, whiten = _sizes(posterior, part), _whiten(posterior, part)
        left.append(LeftByDraws(place, sizes, part.residual[taken], whiten))
        names = tuple(n for n in effect_names(fit.case) if n not in known)
        shares[names] = shares.get(names, 0.0) + len(place) / DRAWS
    readings = groups[0][0].terms.readings
    remarks = (*warnings, *_remarks(shares, bool(case.explanations)))
    draws = SoilDraws(tuple(paths), values)
    return MeasuredSoil(whole, draws, unknown, remarks, readings, left, INTERVAL_FACTOR)


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
