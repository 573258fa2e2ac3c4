"""One wheel, or another gear, as a recipe has it: how it is driven, and which soils there are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from datagen.recipe import Recipe
from soilml.errors import InputError
from soilml.noise import Noise
from soilml.operating import Operating
from soilml.quantities import column
from training.graph import Graph
from training.sets.axis import Axis
from training.sets.driving import driven
from training.sets.family import ABSENT, CHANNELS, Context, Sets

Floats = NDArray[np.float64]

#: Unknowns that polynomials of the third degree can still follow.
MOST_AXES = 6
#: Slips and loads are learned a little beyond the recipe's ends, for sensors stray.
MARGIN = 0.02
#: Share of simulated sets in which sinkage and drawbar pull are measured beside torque.
TOLD = 0.3


@dataclass(frozen=True)
class OneWheel:
    """A recipe's gear and effects on soils of its prior; a design is (slip, load)."""

    recipe: Recipe
    axes: tuple[Axis, ...]
    targets: int
    free: int
    degree: tuple[int, int]

    @staticmethod
    def of(recipe: Recipe, targets: Sequence[str]) -> OneWheel:
        """Raises `InputError` for a recipe that has braking, covariates or too many unknowns."""
        prior = recipe.case.prior
        names = [*targets, *(name for name in prior if name not in targets)]
        if missing := [name for name in targets if name not in prior]:
            raise InputError(f"set_posterior: the recipe has no prior of {missing[0]}")
        if len(names) > MOST_AXES:
            raise InputError(
                f"set_posterior: the recipe has {len(names)} unknowns, more than {MOST_AXES}"
            )
        if recipe.slip.lower <= 0.0 or recipe.covariates or recipe.stick_slip is not None:
            raise InputError(
                "set_posterior: it is for driving wheels (slip above 0) whose torque follows from "
                "slip, load and soil alone; leave it out of the spec"
            )
        axes = tuple(Axis.of(name, prior[name]) for name in names)
        degree = (4, 4) if len(axes) <= 3 else (3, 4)
        return OneWheel(recipe, axes, len(targets), len(axes), degree)

    def designs(self, count: int, seed: int) -> Floats:
        """Slips and loads (count, 2)."""
        u = qmc.Sobol(2, rng=seed).random(1 << (count - 1).bit_length())[:count]
        u = u * (1.0 + 2.0 * MARGIN) - MARGIN
        slip = self.recipe.slip.at(u[:, 0])
        load = self.recipe.load.at(u[:, 1])
        slip = np.clip(slip, 0.5 * self.recipe.slip.lower, 0.999)
        return np.stack([slip, np.maximum(load, 0.5 * self.recipe.load.lower)], axis=1)

    def features(self, designs: Floats) -> Floats:
        """Logarithms of slip and load."""
        return np.log(designs)

    def answers(self, designs: Floats, x: Floats) -> Floats:
        """See `Family`; the length is 1 m."""
        case = self.recipe.case.with_values(
            {axis.name: axis.value(x[..., i]) for i, axis in enumerate(self.axes)}
        )
        slip, load = (designs[:, None, k] for k in (0, 1))
        force = case.model(case.soil, Operating(slip=slip, load=load))
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.stack(
                [np.log(force.torque / load), np.log(force.sinkage), force.drawbar_pull / load],
                axis=-1,
            )

    def inputs(self) -> dict[str, str]:
        """Nothing beside the readings."""
        return {}

    def limits(self) -> dict[str, list[float]]:
        """None, for there are no inputs."""
        return {}

    def draw(self, graph: Graph, readings: dict[str, str]) -> Context:
        """See `Family`."""
        columns = [graph.reshaped(graph.op("Log", readings[k]), -1, 1) for k in ("slip", "load")]
        return Context(
            features=graph.op("Concat", *columns, axis=1),
            length=graph.small(1.0),
            scale=graph.small(np.ones((self.targets, 1))),
            width=graph.small(np.ones((len(self.axes), 1))),
        )

    def sets(self, count: int, rows: int, seed: int) -> Sets:
        """See `Family`; the noise is the recipe's, and channels without noise are not read."""
        rng = np.random.default_rng((seed, rows))
        slip = self.recipe.slip.at(driven(count, rows, rng))
        load = self.recipe.load.at(driven(count, rows, rng))
        x = np.stack([axis.drawn(rng.random(count)) for axis in self.axes], axis=1)
        y = self.answers(
            np.stack([slip, load], axis=-1).reshape(-1, 2), np.repeat(x, rows, axis=0)[:, None]
        ).reshape(count, rows, 3)
        kept = np.isfinite(y).all(axis=(1, 2))
        slip, load, y, x = slip[kept], load[kept], y[kept], x[kept]
        readings = {"slip": slip, "load": load}
        true = (np.exp(y[..., 0]) * load, np.exp(y[..., 1]), y[..., 2] * load)
        told = rng.random((len(x), 1)) < TOLD
        for name, value in zip(CHANNELS, true, strict=True):
            noise = self.recipe.case.noise.get(column(name))
            read = (noise is not None) & (told | (name == "torque"))
            std = np.full_like(value, ABSENT) if noise is None else noise.std(value)
            readings[name] = np.where(read, value + std * rng.standard_normal(std.shape), 1.0)
            readings[f"{name}_std"] = np.where(read, std, ABSENT)
        bias = self.recipe.bias.get(column("torque"), Noise())
        readings["torque_bias"] = bias.std(true[0])
        readings["torque"] += readings["torque_bias"] * rng.standard_normal((len(x), 1))
        truth = [axis.value(x[:, i]) for i, axis in enumerate(self.axes[: self.targets])]
        return Sets(readings, {}, np.stack(truth, axis=1))

    def metadata(self) -> dict[str, Any]:
        """See `Family`."""
        return {
            "kind": "one wheel",
            "slip": [self.recipe.slip.lower, self.recipe.slip.upper],
            "load": [self.recipe.load.lower, self.recipe.load.upper],
        }
