"""The posterior of a set by importance sampling that learns, as nodes of a graph."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri
from scipy.stats import chi2, qmc
from scipy.stats import t as student

from training.graph import Graph
from training.sets.cholesky import draw_factor
from training.sets.family import Context, Family
from training.sets.polynomial import derivative
from training.sets.response import NEAR, Response

Floats = NDArray[np.float64]

#: Newton's steps along the solved axis in the first round, and in each later one.
STEPS_FIRST, STEPS = 2, 1
#: Degrees of freedom of the proposals: heavy tails, for the posterior need not be normal.
FREEDOM = 6.0
#: How much wider than the curvature says the solved axis is drawn; its width where rows say
#: nothing.
WIDER, OPEN = 1.3, 0.7
#: Powers of the density that the next proposal may be fitted to, and the effective samples that the
#: highest of them must be worth.
POWERS = 3.0 ** -np.arange(15.0)
FITTED = 8.0
#: A round whose samples are worth no more than this takes no part in the answer.
POOR = 5.0


@dataclass(frozen=True)
class Effort:
    """Samples of the prior, of each round after it, and the number of these rounds."""

    first: int
    each: int
    rounds: int


#: Up to so many unknowns, and beyond: the means then stray by 0.1 of a standard deviation.
FEW, EFFORT_FEW, EFFORT_MANY = 3, Effort(256, 256, 2), Effort(512, 256, 2)


@dataclass(frozen=True)
class Sample:
    """Names of graph values: coordinates (p, n), weights (1, n) that sum to 1, misfit (1,)."""

    x: str
    weights: str
    misfit: str


def draw_sample(
    graph: Graph, family: Family, response: Response, context: Context, system: str
) -> Sample:
    r"""Weighted samples of the posterior of a system (m, terms) of residuals.

    .. math:: \log p(x | y) = \sum_i \lambda_i x_i - \tfrac12 |A b(x)|^2 + const

    The rows of one way to drive fix a thin sheet in the space of unknowns, and a sheet is missed by
    points that are spread over all of it. So all unknowns but one are drawn, and that one, the
    friction angle, which torque follows almost linearly, is first moved onto the sheet by Newton's
    steps, and then drawn about it as widely as the curvature there says. In the first round the
    others are drawn from the prior; in each later one from a t distribution with the mean and
    covariance of the round before, under the highest power of the density that enough samples
    share. Rounds are joined by how many samples they are worth. All draws are fixed numbers, moved
    and stretched: the same set gives the same answer. References: Cornuet et al., Scandinavian J.
    Statistics 39(4), 2012, for the rounds; Robert and Casella 2004, chapter 4, for solving one
    unknown given the others.
    """
    op, small = graph.op, graph.small
    p, free = len(family.axes), family.free
    if free < p:
        system = op("Concat", system, _nearly_known(graph, family, response, context), axis=0)
    effort = EFFORT_FEW if p <= FEW else EFFORT_MANY
    solver = _Solver.of(graph, family, response, system)
    width = op("Gather", context.width, graph.constant(np.asarray(solver.order)), axis=0)
    start, log_start, spread_start, log_spread_start = _prior_points(
        family, solver.order, effort.first
    )
    x = op("Mul", small(start), width) if free < p else small(start)
    rounds: list[tuple[str, str]] = []
    least: list[str] = []
    jitter = op("Mul", small(1e-6 * np.eye(p)), op("Mul", width, width))
    z, log_z, spread, log_spread = _moves(p, effort.each)
    for number in range(effort.rounds + 1):
        if number == 0:
            x, log_sd = solver.drawn(x, spread_start, STEPS_FIRST)
            proposal = small(log_start + log_spread_start)
        else:
            weights = _tempered(graph, rounds[-1][1])
            before = rounds[-1][0]
            mean = op("Gemm", before, weights, transB=1)
            off = op("Sub", before, mean)
            covariance = op("Gemm", op("Mul", off, weights), off, jitter, transB=1)
            x = op("Gemm", draw_factor(graph, covariance, p), small(z), mean)
            x, log_sd = solver.drawn(x, spread, STEPS)
            proposal = small(log_z + log_spread)
        kept = op("Clip", x, small(-1.0), small(1.0))
        misfit = solver.misfit(kept)
        logs = op("Sub", op("MatMul", solver.tilt, x), op("Mul", misfit, small(0.5)))
        logs = op("Add", op("Sub", logs, proposal), log_sd)
        beyond = graph.reduced("ReduceSumSquare", op("Sub", x, kept), 0, keep=True)
        logs = op("Where", op("Greater", beyond, small(0.0)), small(-1e9), logs)
        rounds.append((kept, logs))
        least.append(misfit)
    shares = []
    for number, (_, logs) in enumerate(rounds):
        # too few samples would look too sure: the last round is tempered until there are some
        last = number == effort.rounds
        own = _tempered(graph, logs) if last else op("Softmax", logs, axis=1)
        worth = op("Div", small(1.0), op("ReduceSumSquare", own, keepdims=1))
        shares.append(op("Mul", own, op("Relu", op("Sub", worth, small(POOR)))))
    # where no round is worth anything, the last is all there is
    shares[-1] = op("Add", shares[-1], op("Mul", own, small(1e-3)))
    joined = op("Concat", *shares, axis=1)
    back = graph.constant(np.argsort(solver.order))
    return Sample(
        op("Gather", op("Concat", *[x for x, _ in rounds], axis=1), back, axis=0),
        op("Div", joined, op("ReduceSum", joined, keepdims=1)),
        graph.reshaped(op("ReduceMin", op("Concat", *least, axis=1), keepdims=0), 1),
    )


@dataclass(frozen=True)
class _Solver:
    """Misfit of points (p, n), and one coordinate of them solved for; the solved axis is last."""

    graph: Graph
    response: Response
    order: list[int]  # axes in the order in which coordinates stand here
    system: str
    slope: str  # the system of derivatives along the solved axis
    tilt: str

    @staticmethod
    def of(graph: Graph, family: Family, response: Response, system: str) -> _Solver:
        names = [axis.name for axis in family.axes]
        solved = names.index("friction_angle") if "friction_angle" in names else 0
        order = [i for i in range(len(names)) if i != solved] + [solved]
        slope = graph.op("MatMul", system, graph.small(derivative(response.these, solved + 1)))
        tilt = graph.small(np.asarray([[family.axes[i].tilt for i in order]]))
        return _Solver(graph, response, order, system, slope, tilt)

    def drawn(self, x: str, spread: Floats, steps: int) -> tuple[str, str]:
        """Points with the solved coordinate drawn about the sheet, and log of its spread (1, n)."""
        op, small = self.graph.op, self.graph.small
        p = len(self.order)
        ints = (self.graph.constant(np.asarray([k], dtype=np.int64)) for k in (0, p - 1, p, 0))
        first, last, end, axis = ints
        others = op("Slice", x, first, last, axis)
        solved = op("Slice", x, last, end, axis)
        others_kept = op("Clip", others, small(-1.0), small(1.0))
        for _ in range(steps):
            at = op("Concat", others_kept, op("Clip", solved, small(-1.0), small(1.0)), axis=0)
            basis = self._basis(at)
            residual, rise = (op("MatMul", part, basis) for part in (self.system, self.slope))
            bend = self.graph.reduced("ReduceSumSquare", rise, 0, keep=True)
            bend = op("Add", bend, small(OPEN**-2))
            pull = self.graph.reduced("ReduceSum", op("Mul", residual, rise), 0, keep=True)
            solved = op("Sub", solved, op("Div", pull, bend))
            solved = op("Clip", solved, small(-1.0), small(1.0))
        width = op("Div", small(WIDER), op("Sqrt", bend))
        solved = op("Add", solved, op("Mul", width, small(spread[None])))
        return op("Concat", others, solved, axis=0), op("Log", width)

    def misfit(self, x: str) -> str:
        """Sum of squared residuals (1, n)."""
        found = self.graph.op("MatMul", self.system, self._basis(x))
        return self.graph.reduced("ReduceSumSquare", found, 0, keep=True)

    def _basis(self, x: str) -> str:
        """Monomials (terms, n) at points (p, n), as products of pairs of coordinates."""
        graph = self.graph
        pads = graph.constant(np.asarray([1, 0, 0, 0], dtype=np.int64))
        one = graph.op("Pad", x, pads, graph.small(1.0))
        place = [0, *(1 + self.order.index(i) for i in range(len(self.order)))]
        halves = [((0, 0, *term)[-4:-2], term[-2:]) for term in self.response.these]
        pairs = sorted({pair for both in halves for pair in both})
        left, right = (self._picked(one, [place[pair[k]] for pair in pairs]) for k in (0, 1))
        table = graph.op("Mul", left, right)
        parts = [self._picked(table, [pairs.index(both[k]) for both in halves]) for k in (0, 1)]
        return graph.op("Mul", *parts)

    def _picked(self, x: str, rows: list[int]) -> str:
        return self.graph.op("Gather", x, self.graph.constant(np.asarray(rows)), axis=0)


def _prior_points(
    family: Family, order: list[int], count: int
) -> tuple[Floats, Floats, Floats, Floats]:
    """Points (p, n) of the prior but for the last, at 0, the log density of what was drawn (1, n).

    And draws of the last axis (n,) with their log density (1, n). Nearly known axes are in standard
    deviations.
    """
    u = qmc.Sobol(len(order), rng=3).random(count)
    points, logs = np.zeros((len(order), count)), np.zeros((1, count))
    for place, i in enumerate(order[:-1]):
        if i < family.free:
            points[place] = family.axes[i].drawn(u[:, place])
            logs += family.axes[i].tilt * points[place]
        else:
            points[place] = np.clip(ndtri(u[:, place]), -NEAR, NEAR)
            logs -= 0.5 * points[place] ** 2
    spread = student.ppf(u[:, -1], FREEDOM)
    return points, logs, spread, student.logpdf(spread, FREEDOM)[None]


def _moves(p: int, count: int) -> tuple[Floats, Floats, Floats, Floats]:
    """Draws (p, n) of a standard t distribution but for the last, 0, and their log density (1, n).

    And draws of the last axis (n,) with their log density (1, n).
    """
    u = qmc.Sobol(p + 1, rng=4).random(count)
    stretch = np.sqrt(FREEDOM / chi2.ppf(u[:, p], FREEDOM))
    z = ndtri(u[:, : p - 1]) * stretch[:, None]
    logs = -0.5 * (FREEDOM + p - 1.0) * np.log1p((z**2).sum(axis=1) / FREEDOM)
    spread = student.ppf(u[:, p - 1], FREEDOM)
    still = np.zeros((count, 1))
    return (
        np.concatenate([z, still], axis=1).T,
        logs[None],
        spread,
        student.logpdf(spread, FREEDOM)[None],
    )


def _nearly_known(graph: Graph, family: Family, response: Response, context: Context) -> str:
    """Rows of the system that hold the prior of nearly known axes: x over its width."""
    p, free = len(family.axes), family.free
    picked = np.zeros((p - free, len(response.these)))
    for row, axis in enumerate(range(free + 1, p + 1)):
        alone = [
            i for i, term in enumerate(response.these) if term == (*(0,) * (len(term) - 1), axis)
        ]
        picked[row, alone[0]] = 1.0
    ends = [graph.constant(np.asarray([k], dtype=np.int64)) for k in (free, p)]
    width = graph.op("Slice", context.width, *ends, graph.constant(np.asarray([0], np.int64)))
    return graph.op("Div", graph.small(picked), width)


def _tempered(graph: Graph, logs: str) -> str:
    """Weights (1, n) of the highest power of the density that enough samples share."""
    op = graph.op
    relative = op("Sub", logs, op("ReduceMax", logs, keepdims=1))
    each = op("Softmax", op("Mul", relative, graph.small(POWERS[:, None])), axis=1)
    crowded = op("Less", graph.reduced("ReduceSumSquare", each, 1), graph.small(1.0 / FITTED))
    first = op("ArgMax", op("Cast", crowded, to=6), axis=0, keepdims=1)
    return op("Gather", each, first, axis=0)
