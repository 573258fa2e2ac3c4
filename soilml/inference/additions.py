"""Predicted values of a hypothesis with one thing more: an effect, free laws, opened priors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from soilml.arrays import Floats
from soilml.fitting.coordinates import Coordinate
from soilml.fitting.effect_signatures import Signature, effect_signatures
from soilml.inference import constants
from soilml.inference.evidence import linear_model, of_priors
from soilml.inference.explanation import Explanation, StartedFit
from soilml.inference.gaussian_terms import Hyperparameters
from soilml.inference.problem import SOIL_ALONE, Hypothesis, exclude_each_other
from soilml.physics.effects.base import REFERENCE_LOAD, log_relative_slip

if TYPE_CHECKING:
    from soilml.inference.search import Search


def additions(
    search: Search, node: Explanation, ladder: Sequence[Hyperparameters]
) -> dict[Hypothesis, StartedFit]:
    """Predicted values of a node's hypothesis with one thing more, the best of a ladder."""
    p = len(node.fit.x)
    extra, moves = _moves(search, node)
    counts = sorted({len(columns) for _, columns, _ in moves})
    alike = [[move for move in moves if len(move[1]) == count] for count in counts]
    model = linear_model(search.terms, node.fit, node.outliers, extra)
    start = node.fit.start_values()
    found: dict[Hypothesis, StartedFit] = {}
    prior = constants.DISCREPANCY_PRIOR
    for at in ladder:
        try:
            products, constant = model.reduced(at)
            own = node.linear.evaluate(at)
            rest = node.linear.beside(at, own.curvature) + of_priors(node.linear, own)
        except np.linalg.LinAlgError:
            continue
        rest -= 2.0 * float(np.log(prior if at.present else 1.0 - prior))
        for group in alike:
            columns = np.asarray([[*range(p), *free] for _, free, _ in group])
            values, steps = model.evidence_with(products, constant, columns, p)
            for (h, _, sign), predicted, step in zip(group, values, steps[:, p], strict=True):
                value = float(predicted) + rest + search.problem.penalty(h)
                if sign and step * sign <= 0.0:
                    continue
                if h not in found or value < found[h].value:
                    found[h] = StartedFit(h, start, at, node.outliers, value=value)
    return found | _by_catalogue(search, node, start) | _opened(search, node, start)


def _moves(
    search: Search, node: Explanation
) -> tuple[list[tuple[Coordinate, Floats]], list[tuple[Hypothesis, list[int], int]]]:
    """Further coordinates with their columns, and hypotheses with the numbers of theirs.

    The third entry of a move is the sign that the size of its effect must have, or 0.
    """
    h, fit, problem = node.hypothesis, node.fit, search.problem
    slip, load = problem.readings.slip, problem.readings.load
    # zero where the size of an effect is its parameter's value
    terms = {"slip_power": log_relative_slip(slip), "by_slip": slip}
    terms["by_load"] = np.log(load / REFERENCE_LOAD)
    extra: list[tuple[Coordinate, Floats]] = []
    moves: list[tuple[Hypothesis, list[int], int]] = []
    p = len(fit.x)
    if len(h.effects) < constants.MOST_EFFECTS:
        for signature in _signatures(search, node):
            shapes = problem.shapes(signature.name)
            names, first = tuple(sorted((*h.effects, signature.name))), p + len(extra)
            extra.append((problem.size(signature.name), signature.column))
            extra += [(c, signature.column * terms[c.name]) for c in shapes]
            free = [*range(first, first + 1 + len(shapes))]
            if not h.free_law or not h.effects:
                moves.append((replace(h, effects=names, free_law=False), [first], signature.sign))
            if shapes and (h.free_law or not h.effects):
                moves.append((replace(h, effects=names, free_law=True), free, signature.sign))
            elif h.free_law:
                moves.append((replace(h, effects=names), [first], signature.sign))
    if h.effects and not h.free_law:
        first = p + len(extra)
        for i, own in enumerate(fit.coordinates):
            if own.of_candidate:
                column = fit.derivatives[:, i] * fit.x[i]
                extra += [(c, column * terms[c.name]) for c in problem.shapes(own.effect)]
        if p + len(extra) > first:
            moves.append((replace(h, free_law=True), [*range(first, p + len(extra))], 0))
    return extra, moves


def _signatures(search: Search, node: Explanation) -> list[Signature]:
    """How the readings change with each effect that may act beside those of a node."""
    effects, names = search.problem.effects, node.hypothesis.effects
    others = {
        name: effect
        for name, effect in effects.items()
        if not any(exclude_each_other(effect, effects[present]) for present in names)
    }
    case, readings = node.fit.fitted(), search.problem.readings
    found, untestable = effect_signatures(case, readings, others)
    if node.hypothesis == SOIL_ALONE:
        search.untestable = untestable
    search.signatures[names] = found
    return found


def _by_catalogue(
    search: Search, node: Explanation, start: Mapping[str, float]
) -> dict[Hypothesis, StartedFit]:
    """The hypothesis by the catalogue's laws, where that with free ones is a node.

    A fit from there reaches optima that predictions from the soil alone miss.
    """
    if not node.hypothesis.free_law:
        return {}
    own = replace(node.hypothesis, free_law=False)
    return {own: StartedFit(own, start, node.at, node.outliers, value=node.value)}


def _opened(
    search: Search, node: Explanation, start: Mapping[str, float]
) -> dict[Hypothesis, StartedFit]:
    """The hypothesis with the priors of its soil opened, where that can matter.

    The fit presses against one of them, or a large discrepancy is left.
    """
    h, problem = node.hypothesis, search.problem
    if h.wide_priors or problem.wide_soil == problem.soil:
        return {}
    ends = [
        min(x - c.lower, c.upper - x)
        for c, x in zip(node.fit.coordinates, node.fit.x, strict=True)
        if not c.of_candidate
    ]
    large = search.terms.amplitude(node.at).max(initial=0.0) > constants.LARGE_DISCREPANCY
    if min(ends, default=1.0) >= constants.PRESSED and not large:
        return {}
    values = node.fit.values()
    inside = constants.PRESSED, 1.0 - constants.PRESSED  # a start at a bound would stay there
    opened = {
        c.path: float(np.clip(c.prior.fraction(values.get(c.path, c.nominal)), *inside))
        for c in problem.wide_soil
    }
    wide = replace(h, wide_priors=True)
    start = {**start, **opened}
    return {wide: StartedFit(wide, start, node.at, node.outliers, value=node.value)}
