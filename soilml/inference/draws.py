"""Draws of a posterior: hypothesis, hyperparameters, and coordinates weighted by the full model."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from soilml.arrays import Floats
from soilml.inference.explanation import Explanation
from soilml.inference.gaussian_terms import GaussianTerms, Hyperparameters
from soilml.inference.priors import log_density_of_size
from soilml.quantities import Z_90
from soilml.results import EstimatedValue

#: Draws of a posterior, hyperparameters that are drawn of a component at most, draws of each at
#: least, and proposals of each draw.
DRAWS, HYPER_DRAWS, FEWEST, PROPOSALS = 600, 24, 8, 2
#: Factor on the standard deviations of proposals, which are of Student's t with so many degrees.
PROPOSAL_WIDTH, PROPOSAL_DEGREES = 1.15, 5.0
#: Rounds in which proposals outside of the bounds are drawn again, before they are clipped.
REDRAWN = 12


@dataclass(frozen=True, eq=False)
class Component:
    """A hypothesis, with a discrepancy or without one, and its probability."""

    node: Explanation
    at: Hyperparameters
    weight: float


@dataclass(frozen=True, eq=False)
class Draws:
    """Coordinates (k, p) of one component at hyperparameters that were drawn, and their weights.

    The weights of all draws of a posterior sum to one. `residual` (k, m) is that of the readings.
    """

    node: Explanation
    at: Hyperparameters
    x: Floats
    weight: Floats
    residual: Floats


#: A component at hyperparameters that were drawn, coordinates (k, p), and ln of their density (k,).
_Proposal = tuple[Component, Floats, Floats]


def proposals(
    one: Component, terms: GaussianTerms, total: int, rng: np.random.Generator
) -> list[_Proposal]:
    """Proposals for one component, at hyperparameters that are drawn by Laplace's approximation."""
    count = int(np.ceil(total * one.weight))
    parts = min(HYPER_DRAWS, max(1, count // (FEWEST + FEWEST // 2)))
    curvature = one.node.linear.evaluate(one.at).curvature
    low, high = np.asarray(terms.bounds()).T
    found = []
    for _ in range(parts):
        at = one.at
        if parts > 1:
            spread = rng.standard_normal(len(at.log)) / np.sqrt(np.maximum(curvature, 0.5))
            at = replace(at, log=np.clip(at.log + spread, low, high))
        try:
            linear = one.node.linear.evaluate(at)
        except np.linalg.LinAlgError:
            at, linear = one.at, one.node.linear.evaluate(one.at)
        wanted = PROPOSALS * max(FEWEST, count // parts)
        own = Component(one.node, at, one.weight / parts)
        found.append((own, *_proposed(one.node, linear.step, linear.covariance, wanted, rng)))
    return found


def _proposed(
    node: Explanation, step: Floats, covariance: Floats, wanted: int, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """Coordinates (k, p) of Student's t about the optimum, within bounds, and ln densities (k,)."""
    coordinates, nu = node.fit.coordinates, PROPOSAL_DEGREES
    low = np.asarray([c.lower for c in coordinates])
    high = np.asarray([c.upper for c in coordinates])
    mean, p = np.clip(node.fit.x + step, low, high), len(low)
    factor = PROPOSAL_WIDTH * np.linalg.cholesky(covariance + 1e-14 * np.eye(p))
    kept: list[Floats] = []
    for _ in range(REDRAWN):
        need = wanted - sum(map(len, kept))
        if need <= 0:
            break
        z = rng.standard_normal((6 * need + 8, p))
        z /= np.sqrt(rng.chisquare(nu, len(z)) / nu)[:, None]
        x = mean + z @ factor.T
        kept.append(x[((x >= low) & (x <= high)).all(axis=1)][:need])
    missing = wanted - sum(map(len, kept))
    if missing > 0:
        kept.append(np.clip(mean + rng.standard_normal((missing, p)) @ factor.T, low, high))
    x = np.concatenate(kept)
    z = np.linalg.solve(factor, (x - mean).T)
    return x, -0.5 * (nu + p) * np.log1p((z**2).sum(axis=0) / nu)


def weighted(own: Component, x: Floats, log_density: Floats, terms: GaussianTerms) -> Draws:
    """Proposals weighted by their density; equally where the model carries none of them."""
    fit = own.node.fit
    start = replace(fit.linearisation.sinkage_at(x), nearest=True)
    near = own.node.linear.residual - (x - fit.x) @ fit.derivatives.T
    equal = Draws(own.node, own.at, x, np.full(len(x), own.weight / len(x)), near)
    residual = np.asarray(terms.readings.measured - fit.problem.predict(x, start))
    answered = np.asarray(np.isfinite(residual).all(axis=1))
    if not answered.any():
        return equal
    white = terms.whiten(own.at, own.node.outliers) @ np.where(answered[:, None], residual, 0.0).T
    log = -0.5 * (white**2).sum(axis=0) - 0.5 * (fit.soil_tests.deviation(x) ** 2).sum(axis=1)
    for i, c in enumerate(fit.coordinates):
        if np.isfinite(c.std):
            log = log - 0.5 * (x[:, i] / c.std) ** 2
        elif c.of_candidate:
            log = log + log_density_of_size(x[:, i], c.lower < 0.0 < c.upper)
    log = np.where(answered, log - log_density, -np.inf)
    weight = np.exp(log - np.logaddexp.reduce(log))
    residual = np.where(answered[:, None], residual, near)
    return Draws(own.node, own.at, x, own.weight * weight, residual)


def marginal(values: Floats, weights: Floats, unit: str, factor: float) -> EstimatedValue:
    """Mean of weighted values (k,), and the standard deviation of a normal distribution whose
    central 90 % interval is `factor` times as wide as theirs.
    """
    order = np.argsort(values)
    share = weights[order] / weights.sum()
    middle = np.cumsum(share) - 0.5 * share
    low, high = np.interp([0.05, 0.95], middle, values[order]).tolist()
    mean = float(weights @ values / weights.sum())
    return EstimatedValue(mean, factor * (high - low) / (2.0 * Z_90), unit)
