"""What a set posterior must know of the wheels and soils that it is for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from training.onnx_graph.builder import Graph
from training.set_posterior.coordinates import Coordinate

Floats = NDArray[np.float64]

#: Channels of a row, in the order in which a response predicts them.
CHANNELS = ("torque", "sinkage", "drawbar_pull")
#: Standard deviation that says that a channel was not measured; the reading is then 1.
ABSENT = 1e6


@dataclass(frozen=True)
class Context:
    """Names of graph values that a family computes from its inputs, float32."""

    features: str  # (rows, f)
    torque: str  # (rows,) the reading as the response answers it
    rise: str  # (rows,) what that gains with torque, 1 / (N m)
    clear: float  # a torque with more noise than this share of it counts for nothing
    length: str  # that sinkage, and torque over load, are measured in, m
    scale: str  # (q, 1) by which the values of the estimated axes are multiplied
    width: str  # (p, 1) of each axis: 1, or the standard deviation where it is nearly known


@dataclass(frozen=True)
class Origin:
    """How simulated sets came about, for who wants their exact posterior.

    `noise` has for each channel that was read, and for `torque_bias`, its constant part and its
    share of the true value, (sets, rows) each.
    """

    designs: Floats  # (sets, rows, d)
    x: Floats  # (sets, p) coordinates of all unknowns
    near: Floats  # (sets,) standard deviation of the coordinates of nearly known axes
    length: Floats  # (sets,) that sinkage, and torque over load, are measured in, m
    noise: dict[str, tuple[Floats, Floats]]


@dataclass(frozen=True)
class SimulatedSets:
    """Simulated sets of one size: the true way they were driven, and what is not known of them.

    `readings` are what the sensors say, by input name (sets, rows); `context` what holds for a
    whole set, by input name (sets,); `truth` the estimated parameters (sets, q).
    """

    readings: dict[str, Floats]
    context: dict[str, Floats]
    truth: Floats
    origin: Origin

    def rows(self, index: int) -> dict[str, Floats]:
        """The readings of one set (rows,)."""
        return {name: values[index] for name, values in self.readings.items()}

    def given(self, index: int) -> dict[str, float]:
        """The context of one set."""
        return {name: float(values[index]) for name, values in self.context.items()}

    def only(self, index: int) -> SimulatedSets:
        """One of the sets."""
        own, part = self.origin, slice(index, index + 1)
        noise = {name: (a[part], b[part]) for name, (a, b) in own.noise.items()}
        return SimulatedSets(
            {name: values[part] for name, values in self.readings.items()},
            {name: values[part] for name, values in self.context.items()},
            self.truth[part],
            Origin(own.designs[part], own.x[part], own.near[part], own.length[part], noise),
        )


#: Stands for what has no logarithm, and is out of range.
TINY = 1e-12
#: A torque or sinkage with more noise than this share of it has no logarithm to be believed.
CLEAR = 1.0 / 3.0


def draw_log_torque(graph: Graph, readings: dict[str, str], length: str) -> tuple[str, str]:
    """Logarithm of torque over load and length (rows,), and what it gains with torque.

    The mean of the logarithm of a noisy reading lies below that of the truth by half of the squared
    share of noise, which is added.
    """
    op, small = graph.op, graph.small
    torque = op("Max", readings["torque"], small(TINY))
    share = op("Div", readings["torque_std"], torque)
    short = op("Min", op("Mul", op("Mul", share, share), small(0.5)), small(0.02))
    grip = op("Div", torque, op("Mul", readings["load"], length))
    return op("Add", op("Log", grip), short), op("Div", small(1.0), torque)


class WheelFamily(Protocol):
    """Wheels on soils: how they are driven, how they answer, and what a graph reads of them.

    A design is one way to drive one wheel, a row (n, d) of numbers whose meaning is the family's
    own. Axes come in three kinds: first those that are estimated, then others that lie anywhere in
    their range, and last those that are nearly known, with a normal prior around 0.
    """

    @property
    def axes(self) -> tuple[Coordinate, ...]:
        """All unknowns."""
        ...

    @property
    def targets(self) -> int:
        """How many of them are estimated."""
        ...

    @property
    def free(self) -> int:
        """How many lie anywhere in their range."""
        ...

    @property
    def degree(self) -> tuple[int, int]:
        """Of the polynomial, and of its terms of the estimated axes alone."""
        ...

    def designs(self, count: int, seed: int) -> Floats:
        """Ways to drive (count, d), which the soil carries, spread over the range."""
        ...

    def features(self, designs: Floats) -> Floats:
        """What the response depends on, smooth and of order one, (n, f)."""
        ...

    def answers(self, designs: Floats, x: Floats) -> Floats:
        """Channels (n, m, 3) at coordinates x (n, m, p).

        They are a rising function of torque along which its noise is the same everywhere, the
        logarithm of sinkage over length, and drawbar pull over load; NaN without equilibrium.
        """
        ...

    def inputs(self) -> dict[str, str]:
        """What the graph reads beside the readings and holds for all rows: name -> unit."""
        ...

    def limits(self) -> dict[str, list[float]]:
        """Least and most of each of `inputs`."""
        ...

    def draw(self, graph: Graph, readings: dict[str, str]) -> Context:
        """Computes the context from graph values of the readings (rows,) and of `inputs`."""
        ...

    def sets(self, count: int, rows: int, seed: int) -> SimulatedSets:
        """Sets of rows as a rover may drive them, with all noise; soils of the prior."""
        ...

    def metadata(self) -> dict[str, Any]:
        """Ranges and axes, for the file and its card."""
        ...
