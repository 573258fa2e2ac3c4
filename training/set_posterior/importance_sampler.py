"""The posterior of a set by importance sampling that learns, as nodes of a graph."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri
from scipy.stats import chi2, qmc
from scipy.stats import t as student

from training.onnx_graph.builder import Graph
from training.onnx_graph.cholesky import draw_factor
from training.set_posterior.monomials import derivative, monomials
from training.set_posterior.response_surface import NEAR, Response
from training.set_posterior.wheel_family import Context, WheelFamily

Floats = NDArray[np.float64]

#: Newton's steps along the solved axis in the first round, and in each later one.
STEPS_FIRST, STEPS = 2, 1
#: Degrees of freedom of the proposals: heavy tails, for the posterior need not be normal.
FREEDOM = 6.0
#: How much wider than the curvature says the solved axis is drawn; its width where rows say
#: nothing.
WIDER, OPEN = 1.3, 0.7
#: The next proposal is fitted to that power of the density under which the best samples, so many,
#: differ by no more than this in its logarithm.
BEST, APART = 16, 3.0
#: What a sample outside of the box loses of the logarithm of its density, by its distance.
OUTSIDE = 1e9
#: Coordinates are drawn as hyperbolic tangents, up to this.
MOST = 1.0 - 1e-6


@dataclass(frozen=True)
class Effort:
    """Samples of the prior, of each round after it, and the number of these rounds."""

    first: int
    each: int
    rounds: int


#: Up to so many unknowns, and beyond: the means then stray by 0.1 of a standard deviation.
FEW, EFFORT_FEW, EFFORT_MANY = 3, Effort(256, 128, 2), Effort(512, 256, 3)


@dataclass(frozen=True)
class Sample:
    """Names of graph values: points (1 + p, n), weights (1, n) that sum to 1, least misfit (1,).

    A point is 1 and its coordinates, of which `order` says which axes they are; n is `count`.
    """

    points: str
    weights: str
    misfit: str
    count: int
    order: tuple[int, ...]


def draw_sample(
    graph: Graph, family: WheelFamily, response: Response, context: Context, system: str
) -> Sample:
    r"""Weighted samples of the posterior of a system (m, terms) of residuals.

    .. math:: \log p(x | y) = \sum_i \lambda_i x_i - \tfrac12 |A b(x)|^2 + const

    The rows of one way to drive fix a thin sheet in the space of unknowns, and a sheet is missed by
    points that are spread over all of it. So all unknowns but one are drawn, and that one, the
    friction angle, which torque follows almost linearly, is first moved onto the sheet by Newton's
    steps, and then drawn about it as widely as the curvature there says. In the first round the
    others are drawn from the prior. In each later one their inverse hyperbolic tangents, which have
    no ends, are drawn from a t distribution with the mean and covariance of the round before, under
    the highest power of the density that enough samples share. Rounds are joined by how many
    samples they are worth. All draws are fixed numbers, moved and stretched: the same set gives the
    same answer. References: Cornuet et al., Scandinavian J. Statistics 39(4), 2012, for the rounds;
    Robert and Casella 2004, chapter 4, for solving one unknown given the others.
    """
    op, small = graph.op, graph.small
    p = len(family.axes)
    effort = EFFORT_FEW if p <= FEW else EFFORT_MANY
    solver = _Solver.of(
        graph, family, response, _in_widths(graph, family, response, context, system)
    )
    jitter = small(np.diag([0.0, *[1e-6] * p]))
    z, log_z, spread, log_spread = _moves(p, effort.each)
    prior, *drawn = _prior_points(family, solver.order, effort.first)
    points, (near, logs), misfit = solver.first(prior, *drawn)
    wide = small(np.arctanh(np.clip(prior[:-1], -MOST, MOST)))
    every, shares, least = [points], [], [misfit]
    for _ in range(effort.rounds):
        power = _power(graph, near)
        weights = op("Softmax", op("Mul", logs, power), axis=1)
        worth = op("Div", op("Floor", power), op("ReduceSumSquare", weights, keepdims=1))
        shares.append(op("Mul", weights, worth))  # none where the density had to be tempered
        count = effort.each if every[1:] else effort.first
        solved = op("Gather", points, graph.constant(np.asarray([p], np.int64)), axis=0)
        open_ = op("Concat", small(np.ones((1, count))), wide, solved, axis=0)
        moments = op("Gemm", op("Mul", open_, weights), open_, jitter, transB=1)
        start = op("MatMul", draw_factor(graph, moments, p), small(z))
        wide, points, (near, logs), misfit = solver.drawn(start, spread, log_z + log_spread)
        every.append(points)
        least.append(misfit)
    # too few samples would look too sure: the last round is tempered until there are some
    own = op("Softmax", op("Mul", logs, _power(graph, near)), axis=1)
    shares.append(op("Div", own, op("ReduceSumSquare", own, keepdims=1)))
    joined = op("Concat", *shares, axis=1)
    return Sample(
        op("Concat", *every, axis=1),
        op("Div", joined, op("ReduceSum", joined, keepdims=1)),
        graph.reshaped(op("ReduceMin", op("Concat", *least, axis=1), keepdims=0), 1),
        effort.first + effort.rounds * effort.each,
        tuple(solver.order),
    )


@dataclass(frozen=True)
class _Solver:
    """Density of points (1 + p, n): 1, coordinates in `order`, and last the one solved for."""

    graph: Graph
    response: Response
    order: list[int]  # axes in the order in which coordinates stand here
    system: str
    both: str  # (2, m, terms): the system, and that of derivatives along the solved axis
    tilt: list[float]

    @staticmethod
    def of(graph: Graph, family: WheelFamily, response: Response, system: str) -> _Solver:
        names = [axis.name for axis in family.axes]
        solved = names.index("friction_angle") if "friction_angle" in names else 0
        order = [i for i in range(len(names)) if i != solved] + [solved]
        slope = derivative(response.these, solved + 1)
        both = graph.op("MatMul", system, graph.small(np.stack([np.eye(len(slope)), slope])))
        tilt = [family.axes[i].tilt for i in order]
        return _Solver(graph, response, order, system, both, tilt)

    def first(
        self, points: Floats, logs: Floats, spread: Floats, log_spread: Floats
    ) -> tuple[str, list[str], str]:
        """As `drawn`, by fixed points (p, n), the last coordinate 0: all that follows is fixed."""
        op, small = self.graph.op, self.graph.small
        basis = monomials(points[np.argsort(self.order)].T, self.response.these)
        both = op("MatMul", self.both, small(basis.T))
        residual, rise = self.graph.ops("Split", 2, both, axis=0, num_outputs=2)
        others = small(points[:-1])
        solved, bend = self._moved(small(0.0), residual, rise)
        for _ in range(STEPS_FIRST - 1):
            solved, bend = self._step(others, solved, len(spread))
        return self._spread(others, solved, bend, spread, logs + log_spread)

    def drawn(self, start: str, spread: Floats, logs: Floats) -> tuple[str, str, list[str], str]:
        """Unbounded others (p - 1, n), and points with the solved coordinate drawn about the sheet.

        And the logarithms (1, n) of what they weigh, in the box and at all, and their misfit
        (1, n), the sum of squared residuals. `logs` (1, n) is that of the density which others and
        spread (n,) were drawn by.
        """
        graph, op, small = self.graph, self.graph.op, self.graph.small
        sizes = graph.constant(np.asarray([1, len(self.order) - 1, 1], dtype=np.int64))
        _, wide, solved = graph.ops("Split", 3, start, sizes, axis=0)
        others = op("Tanh", wide)
        shrunk = op("Sub", small(1.0), op("Mul", others, others))
        shrunk = op("Log", op("Max", shrunk, small(1.0 - MOST**2)))
        for _ in range(STEPS):
            solved, bend = self._step(others, solved, len(spread))
        return wide, *self._spread(others, solved, bend, spread, logs, shrunk)

    def _step(self, others: str, solved: str, count: int) -> tuple[str, str]:
        op, one = self.graph.op, self.graph.small(np.ones((1, count)))
        at = self._kept(op("Concat", one, others, solved, axis=0))
        both = op("MatMul", self.both, self._basis(at))
        residual, rise = self.graph.ops("Split", 2, both, axis=0, num_outputs=2)
        return self._moved(solved, residual, rise)

    def _moved(self, solved: str, residual: str, rise: str) -> tuple[str, str]:
        """The solved coordinate after a step, and the curvature (1, n) there."""
        graph, op, small = self.graph, self.graph.op, self.graph.small
        bend = graph.reduced("ReduceSumSquare", rise, 1)
        bend = op("Add", bend, small(OPEN**-2))
        pull = graph.reduced("ReduceSum", op("Mul", residual, rise), 1)
        return self._kept(op("Sub", solved, op("Div", pull, bend))), bend

    def _spread(
        self, others: str, solved: str, bend: str, spread: Floats, logs: Floats, *shrunk: str
    ) -> tuple[str, list[str], str]:
        graph, op, small = self.graph, self.graph.op, self.graph.small
        one = small(np.ones((1, len(spread))))
        drawn = op("Add", solved, op("Div", small(WIDER * spread[None]), op("Sqrt", bend)))
        free = op("Concat", one, others, drawn, axis=0)
        points = self._kept(free)
        found = op("MatMul", self.system, self._basis(points))
        misfit = graph.reduced("ReduceSumSquare", found, 0, keep=True)
        beyond = graph.reduced("ReduceL1", op("Sub", free, points), 0, keep=True)
        parts = op("Concat", points, op("Log", bend), misfit, *shrunk, beyond, axis=0)
        # what the sample would be worth inside of the box, and what it is worth
        own = [0.0, *self.tilt, -0.5, -0.5, *[1.0] * (len(self.order) - 1 if shrunk else 0)]
        both = op("Gemm", small([[*own, 0.0], [*own, -OUTSIDE]]), parts, small(-logs))
        return points, graph.ops("Split", 2, both, axis=0, num_outputs=2), misfit

    def _kept(self, x: str) -> str:
        return self.graph.op("Clip", x, self.graph.small(-1.0), self.graph.small(1.0))

    def _basis(self, points: str) -> str:
        """Monomials (terms, n) at points (1 + p, n), as products of pairs of coordinates."""
        place = [0, *(1 + self.order.index(i) for i in range(len(self.order)))]
        halves = [((0, 0, *term)[-4:-2], term[-2:]) for term in self.response.these]
        pairs = sorted({pair for both in halves for pair in both})
        left, right = (self._picked(points, [place[pair[k]] for pair in pairs]) for k in (0, 1))
        table = self.graph.op("Mul", left, right)
        parts = [self._picked(table, [pairs.index(both[k]) for both in halves]) for k in (0, 1)]
        return self.graph.op("Mul", *parts)

    def _picked(self, x: str, rows: list[int]) -> str:
        return self.graph.op("Gather", x, self.graph.constant(np.asarray(rows)), axis=0)


def _prior_points(
    family: WheelFamily, order: list[int], count: int
) -> tuple[Floats, Floats, Floats, Floats]:
    """Points (p, n) of the prior but for the last, at 0, the log density of what was drawn (1, n).

    And draws of the last axis (n,) with their log density (1, n).
    """
    u = qmc.Sobol(len(order), rng=3).random(count)
    points, logs = np.zeros((len(order), count)), np.zeros((1, count))
    for place, i in enumerate(order[:-1]):
        if i < family.free:
            points[place] = family.axes[i].drawn(u[:, place])
            logs += family.axes[i].tilt * points[place]
        else:
            points[place] = np.clip(ndtri(u[:, place]) / NEAR, -1.0, 1.0)
            logs -= 0.5 * (NEAR * points[place]) ** 2
    spread = student.ppf(u[:, -1], FREEDOM)
    return points, logs, spread, student.logpdf(spread, FREEDOM)[None]


def _moves(p: int, count: int) -> tuple[Floats, Floats, Floats, Floats]:
    """Draws (p, n) of 1 and a standard t distribution, and their log density (1, n).

    And draws of the last axis (n,) with their log density (1, n).
    """
    u = qmc.Sobol(p + 1, rng=4).random(count)
    stretch = np.sqrt(FREEDOM / chi2.ppf(u[:, p], FREEDOM))
    z = ndtri(u[:, : p - 1]) * stretch[:, None]
    logs = -0.5 * (FREEDOM + p - 1.0) * np.log1p((z**2).sum(axis=1) / FREEDOM)
    spread = student.ppf(u[:, p - 1], FREEDOM)
    return (
        np.concatenate([np.ones((count, 1)), z], axis=1).T,
        logs[None],
        spread,
        student.logpdf(spread, FREEDOM)[None],
    )


def _in_widths(
    graph: Graph, family: WheelFamily, response: Response, context: Context, system: str
) -> str:
    """The system with nearly known axes in `NEAR` of their widths, and their prior as rows of it.

    All coordinates are then between -1 and 1.
    """
    p, free, these = len(family.axes), family.free, response.these
    if free == p:
        return system
    power = np.asarray([[term.count(axis) for term in these] for axis in range(1, p + 1)])
    power[:free] = 0
    log = graph.op("Log", graph.op("Mul", context.width, graph.small(NEAR)))
    size = graph.op("Exp", graph.op("Gemm", log, graph.small(power), transA=1))
    alone = [these.index((*(0,) * (len(these[0]) - 1), axis)) for axis in range(free + 1, p + 1)]
    prior = graph.small(NEAR * np.eye(len(these))[alone])
    return graph.op("Concat", graph.op("Mul", system, size), prior, axis=0)


def _power(graph: Graph, logs: str) -> str:
    """The highest power, up to 1, of the density that the best samples share, (1, 1)."""
    op = graph.op
    best, _ = graph.ops("TopK", 2, logs, graph.constant(np.asarray([BEST], np.int64)), axis=1)
    ends = graph.small(np.eye(BEST)[:, :1] - np.eye(BEST)[:, -1:])
    range_ = op("MatMul", best, ends)
    return op("Min", op("Div", graph.small(APART), range_), graph.small(1.0))
