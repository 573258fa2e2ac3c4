"""Draws of one posterior: soil, effects and the model's error together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.config.measurement_noise import Discrepancy, range_with_zero
from soilml.errors import FitError, InputError
from soilml.fitting.candidate_effects import candidate_effects, effect_names
from soilml.fitting.coordinates import Coordinate, select_free, values_at
from soilml.fitting.covariance import USUAL
from soilml.fitting.mixtures import with_all_effects
from soilml.fitting.predictions import forces
from soilml.fitting.readings import Readings
from soilml.inference.constants import INTERVAL_FACTOR
from soilml.inference.draws import Draws
from soilml.inference.gaussian_terms import FIXED
from soilml.inference.posterior import Posterior, infer
from soilml.inference.problem import InferenceProblem
from soilml.numerics.quantiles import systematic_resampling
from soilml.numerics.smooth_process import SmoothFunctions, process_columns, slip_load_points
from soilml.physics.effects import EFFECTS
from soilml.processes import threads_for
from soilml.quantities import column
from soilml.remarks import Remark
from soilml.report.numbers import format_probability
from soilml.traction.draws import DrawnErrors, SoilDraws

#: Correlation lengths outside the range of the readings within which the drawn error fades. Of 1
#: and 2, 1 scored better under lighter loads and beyond the slips, seeds 1 and 2.
FADING_LENGTH = 1.0
#: Fewest draws of one of several explanations, before they are weighted.
FEWEST = 60
#: Probability that the model lacks an effect from which a remark is made.
NOTABLE = 0.5
MOST_SAID = 3  # Explanations that a remark lists


@dataclass(frozen=True, eq=False)
class PosteriorDraws:
    """Equally weighted draws of one or several posteriors.

    case: The case with the effects of all draws, whose values are in `soil`.
    known: Effects that the case had before.
    several: Whether it had several explanations.
    soil: Values (n, p).
    parts: Posterior and draws of each group, with the numbers (k,) of the drawn ones, and of the
        equally weighted draws (k,) that they are.
    """

    case: Case
    known: frozenset[str]
    several: bool
    soil: SoilDraws
    parts: tuple[tuple[Posterior, Draws, NDArray[np.int64], NDArray[np.int64]], ...]

    def errors(
        self, slip: Floats, load: Sequence[float], channels: Sequence[str]
    ) -> tuple[DrawnErrors, DrawnErrors]:
        r"""Errors of the model given the readings, and before them, in these ranges.

        Within the range of the readings, the error of a draw is a process with the amplitude of the
        draw, given what the draw leaves of the readings. Beyond it, it fades to one of zero mean
        and of a model's usual error at least:

        .. math:: \delta(x) = q\,\delta(x') + \sqrt{1 - q^2}\; b\,\xi(x), \quad
            q = e^{-d^2 / (2 \lambda^2)}

        with the nearest point x' of the range, at the distance d in correlation lengths.
        """
        rng = np.random.default_rng(0)
        readings = self.parts[0][0].terms.readings
        asked = _ends(np.append(readings.slip, slip)), _ends(np.append(readings.load, load))
        functions = {
            (name, gear): _Fading.of(self.case, readings, gear, name, *asked)
            for name in dict.fromkeys([*channels, *readings.channels])  # all share the rows
            for gear in self.case.gears or [""]
        }
        after = {key: np.zeros((len(self.soil.values), f.count)) for key, f in functions.items()}
        before = {key: np.zeros_like(own) for key, own in after.items()}
        for posterior, drawn, taken, place in self.parts:
            found = _weights(posterior, drawn, taken, functions, rng)
            for key, (own, prior) in found.items():
                after[key][place], before[key][place] = own, prior
        joined = {key: own.joined for key, own in functions.items() if key[0] in channels}
        after, before = ({key: each[key] for key in joined} for each in (after, before))
        return DrawnErrors(joined, after, *asked), DrawnErrors(joined, before, *asked)

    def remarks(self) -> list[Remark]:
        """Which effects the draws have beside those of the case, and how often."""
        known, shares = self.known, dict[tuple[str, ...], float]()
        for _, part, _, place in self.parts:
            effects = effect_names(part.node.fit.case)
            names = tuple(n for n in effects if n not in known)
            shares[names] = shares.get(names, 0.0) + len(place) / len(self.soil.values)
        likely = sorted((n for n in shares if n), key=lambda n: -shares[n])
        if 1.0 - shares.get((), 0.0) < NOTABLE:
            return []
        said = [f"{' + '.join(n)} ({format_probability(shares[n])})" for n in likely[:MOST_SAID]]
        if self.several:
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
    parts = []
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
        parts.append((posterior, part, taken, place))
    before = frozenset(effect_names(case)), bool(case.explanations)
    return PosteriorDraws(whole, *before, SoilDraws(tuple(paths), values), tuple(parts))


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


@dataclass(frozen=True)
class _Fading:
    """Unit functions of one channel of one gear: those of the range, and those beyond it."""

    inside: SmoothFunctions
    beyond: SmoothFunctions
    declared: Discrepancy
    unmeasured: float  # usual error of a channel without readings, in its unit

    @property
    def count(self) -> int:
        return self.inside.count + self.beyond.count

    @cached_property
    def joined(self) -> SmoothFunctions:
        return SmoothFunctions.joined([self.inside, self.beyond])

    @staticmethod
    def of(
        case: Case,
        readings: Readings,
        gear: str,
        channel: str,
        slip: tuple[float, float],
        load: tuple[float, float],
    ) -> _Fading:
        declared = case.discrepancy.get(column(channel), USUAL)
        lengths = declared.slip_length, declared.log_load_length
        driven = _of_gear(readings, gear)
        ends = _ends(readings.slip[driven]), _ends(readings.load[driven])

        def scaled(slip: Floats, load: Floats) -> tuple[Floats, Floats]:
            at = slip_load_points(slip, load, *lengths)
            near = slip_load_points(np.clip(slip, *ends[0]), np.clip(load, *ends[1]), *lengths)
            apart = ((at - near) ** 2).sum(axis=1)
            return near, np.exp(-0.5 * apart / FADING_LENGTH**2)

        def inside(slip: Floats, load: Floats) -> Floats:
            near, share = scaled(slip, load)
            return np.asarray(share[:, None] * process_columns(near))

        def unit(slip: Floats, load: Floats) -> Floats:
            return process_columns(slip_load_points(slip, load, *lengths))

        def lost(slip: Floats, load: Floats) -> Floats:
            return np.asarray(np.sqrt(np.maximum(1.0 - scaled(slip, load)[1] ** 2, 0.0)))

        usual = 0.0
        if channel not in readings.channels:
            predicted = getattr(forces(case, readings.at), channel)
            usual = declared.amplitude(range_with_zero(np.asarray(predicted)))
        return _Fading(
            SmoothFunctions.of(inside, lengths, slip, load),
            SmoothFunctions.of(unit, lengths, slip, load).times(lost),
            declared,
            usual,
        )


Key = tuple[str, str]


def _weights(
    posterior: Posterior,
    drawn: Draws,
    taken: NDArray[np.int64],
    functions: Mapping[Key, _Fading],
    rng: np.random.Generator,
) -> dict[Key, tuple[Floats, Floats]]:
    """Weights (k, q) of the functions given what each draw leaves, and before the readings."""
    terms, at, k = posterior.terms, drawn.at, len(taken)
    readings, case = terms.readings, posterior.problem.case
    amplitude = terms.amplitude(at) * terms.usual
    columns, keys, sizes = [], [], {}
    for (channel, gear), own in functions.items():
        if channel not in readings.channels:
            sizes[channel, gear] = (own.unmeasured, own.unmeasured)
            continue
        i = readings.channels.index(channel)
        of = (readings.channel == i) & _of_gear(readings, gear)
        span = range_with_zero(readings.measured[readings.channel == i])
        known = own.declared.amplitude(span) if _is_stated(case, channel) else 0.0
        size = float(np.hypot(amplitude[i], known))
        usual = float(terms.usual[i])
        sizes[channel, gear] = (size, max(size, usual))
        if size > 0.0:
            part = np.zeros((len(readings), own.inside.count))
            part[of] = size * own.inside.at(readings.slip[of], readings.load[of])
            columns.append(part)
            keys.append((channel, gear))
    found = {}
    normal: dict[Key, Floats] = {
        key: rng.standard_normal((k, own.inside.count)) for key, own in functions.items()
    }
    given = dict(normal)
    if columns:
        stated = [i for i, name in enumerate(readings.channels) if _is_stated(case, name)]
        count = int(np.isin(terms.group, stated).sum())
        kept = np.ones(len(terms.group), bool)  # without what is stated, which is in the functions
        kept[np.flatnonzero(terms.group == FIXED)[:count]] = False
        bare = replace(terms, columns=terms.columns[:, kept], group=terms.group[kept], _kept={})
        whiten = bare.whiten(bare.without_discrepancy(at), drawn.node.outliers)
        white = np.asarray(whiten @ np.concatenate(columns, axis=1))
        residual = np.asarray(whiten @ drawn.residual[taken].T)
        factor = np.linalg.cholesky(np.eye(white.shape[1]) + white.T @ white)
        half = np.linalg.solve(factor, white.T @ residual)
        z = INTERVAL_FACTOR * np.concatenate([normal[key] for key in keys], axis=1).T
        weights = np.linalg.solve(factor.T, half + z).T
        ends = np.cumsum([0, *(functions[key].inside.count for key in keys)])
        given |= {key: weights[:, a:b] for key, a, b in zip(keys, ends, ends[1:], strict=False)}
    for key, own in functions.items():
        size, beyond = sizes[key]
        outside = beyond * rng.standard_normal((k, own.beyond.count))
        found[key] = (
            np.concatenate([size * given[key], outside], axis=1),
            np.concatenate([size * normal[key], outside], axis=1),
        )
    return found


def _is_stated(case: Case, channel: str) -> bool:
    stated = case.discrepancy.get(column(channel))
    return stated is not None and stated.amplitude(1.0) > 0.0


def _of_gear(readings: Readings, gear: str) -> NDArray[np.bool_]:
    """Which readings (m,) are of a gear; all where there is one."""
    if not gear or readings.at.gear is None:
        return np.ones(len(readings), bool)
    driven = np.broadcast_to(np.asarray(readings.at.gear), len(readings.run))
    return np.asarray(driven[readings.row] == gear)


def _ends(values: Floats) -> tuple[float, float]:
    return float(np.min(values)), float(np.max(values))
