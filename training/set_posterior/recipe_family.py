"""One wheel, or another gear, as a recipe has it: how it is driven, and which soils there are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from datagen.recipe import Recipe
from soilml.config.measurement_noise import Noise
from soilml.errors import InputError
from soilml.onboard.set_contract import ABSENT_STD, RESPONSE_CHANNELS
from soilml.physics.operating_point import Operating
from soilml.quantities import column
from training.onnx_graph.value import Value, asinh, concat, constant, log, maximum, sqrt
from training.set_posterior.coordinates import Coordinate
from training.set_posterior.run_patterns import run_patterns
from training.set_posterior.wheel_family import (
    MOST_RELATIVE_NOISE,
    SMALLEST,
    ContextValues,
    Origin,
    SimulatedSets,
    add_log_torque,
)

Floats = NDArray[np.float64]

#: Unknowns that polynomials of the third degree can still follow.
MOST_UNKNOWNS = 6
#: Slips and loads are learned a little beyond the recipe's ends, for sensors stray.
RANGE_MARGIN = 0.02
#: Share of simulated sets in which sinkage and drawbar pull are measured beside torque.
SHARE_ALL_CHANNELS = 0.3
#: Up to so many unknowns are followed to the fourth degree, and the estimated ones always.
FEW_UNKNOWNS = 4
#: Least share of noise for which torque is answered, where its noise is constant.
LEAST_SHARE = 0.2
#: Without a logarithm a torque may have any noise.
ANY_NOISE = 1e5


@dataclass(frozen=True)
class RecipeFamily:
    """A recipe's gear and effects on soils of its prior; a design is (slip, load)."""

    recipe: Recipe
    axes: tuple[Coordinate, ...]
    targets: int
    free: int
    degree: tuple[int, int]
    linear_torque: float = 0.0  # N m, below which the torque scale is nearly linear; 0: logarithm

    @staticmethod
    def of(recipe: Recipe, targets: Sequence[str]) -> RecipeFamily:
        """Raises `InputError` for a recipe that has braking, covariates or too many unknowns."""
        prior = recipe.case.prior
        names = [*targets, *(name for name in prior if name not in targets)]
        if missing := [name for name in targets if name not in prior]:
            raise InputError(f"set_posterior: the recipe has no prior of {missing[0]}")
        if len(names) > MOST_UNKNOWNS:
            raise InputError(
                f"set_posterior: the recipe has {len(names)} unknowns, more than {MOST_UNKNOWNS}"
            )
        if recipe.slip.lower <= 0.0 or recipe.covariates or recipe.gear_sensors:
            raise InputError(
                "set_posterior: it is for driving wheels (slip above 0) whose torque follows from "
                "slip, load and soil alone; leave it out of the spec"
            )
        axes = tuple(Coordinate.of(name, prior[name]) for name in names)
        degree = (4, 4) if len(axes) <= FEW_UNKNOWNS else (3, 4)
        family = RecipeFamily(recipe, axes, len(targets), len(axes), degree)
        noise = recipe.case.noise.get(column("torque"), Noise(share=1.0))
        if noise.constant == 0.0:
            return family
        return replace(family, linear_torque=noise.constant / max(noise.share, LEAST_SHARE))

    def designs(self, count: int, seed: int) -> Floats:
        """Slips and loads (count, 2)."""
        u = qmc.Sobol(2, rng=seed).random(1 << (count - 1).bit_length())[:count]
        u = u * (1.0 + 2.0 * RANGE_MARGIN) - RANGE_MARGIN
        slip = self.recipe.slip.at(u[:, 0])
        load = self.recipe.load.at(u[:, 1])
        slip = np.clip(slip, 0.5 * self.recipe.slip.lower, 0.999)
        return np.stack([slip, np.maximum(load, 0.5 * self.recipe.load.lower)], axis=1)

    def features(self, designs: Floats) -> Floats:
        """Logarithms of slip and load."""
        return np.log(designs)

    def responses(self, designs: Floats, x: Floats) -> Floats:
        r"""See `Family`; the length is 1 m.

        Torque is answered as its logarithm over load where its noise is a share of it, and else as

        .. math:: \mathrm{asinh}(T / 2 T_0), \qquad T_0 = \sigma_{constant} / \sigma_{share}

        along which the noise is nearly the same at all torques (Bartlett 1947). Constant noise is
        taken for noise with a share of a fifth: a straight line in torque would bend too much along
        the unknowns, and so the noise of a reading still tells that of the truth within 5 %.
        """
        case = self.recipe.case.with_values(
            {axis.name: axis.value(x[..., i]) for i, axis in enumerate(self.axes)}
        )
        slip, load = (designs[:, None, k] for k in (0, 1))
        force = case.model(case.soil, Operating(slip=slip, load=load))
        with np.errstate(invalid="ignore", divide="ignore"):
            if self.linear_torque:
                torque = np.arcsinh(force.torque / (2.0 * self.linear_torque))
            else:
                torque = np.log(force.torque / load)
            return np.stack([torque, np.log(force.sinkage), force.drawbar_pull / load], axis=-1)

    def inputs(self) -> dict[str, str]:
        """Nothing beside the readings."""
        return {}

    def limits(self) -> dict[str, list[float]]:
        """None, for there are no inputs."""
        return {}

    def add_context(self, readings: dict[str, Value]) -> ContextValues:
        """See `WheelFamily`."""
        operating = concat([readings["slip"], readings["load"]], axis=0)
        log_operating = log(maximum(operating, SMALLEST))
        length = constant(operating.graph, 1.0)
        torque, torque_slope = self._torque(readings, length)
        return ContextValues(
            features=log_operating.reshape(2, -1).node("Transpose"),
            torque=torque,
            torque_slope=torque_slope,
            most_torque_noise=ANY_NOISE if self.linear_torque else MOST_RELATIVE_NOISE,
            length=length,
            target_scale=constant(operating.graph, np.ones((self.targets, 1))),
            axis_std=constant(operating.graph, np.ones((len(self.axes), 1))),
        )

    def _torque(self, readings: dict[str, Value], length: Value) -> tuple[Value, Value]:
        """Torque on the scale of the response, and the derivative of that scale, (rows,)."""
        if not self.linear_torque:
            return add_log_torque(readings, length)
        torque, twice = readings["torque"], 2.0 * self.linear_torque
        response = asinh(torque / twice)
        return response, 1.0 / sqrt(torque * torque + 4.0 * self.linear_torque**2)

    def sets(self, count: int, rows: int, seed: int) -> SimulatedSets:
        """See `Family`; the noise is the recipe's, and channels without noise are not read."""
        rng = np.random.default_rng((seed, rows))
        slip = self.recipe.slip.at(run_patterns(count, rows, rng))
        load = self.recipe.load.at(run_patterns(count, rows, rng))
        x = np.stack([axis.quantile(rng.random(count)) for axis in self.axes], axis=1)
        y = self.responses(
            np.stack([slip, load], axis=-1).reshape(-1, 2), np.repeat(x, rows, axis=0)[:, None]
        ).reshape(count, rows, 3)
        kept = np.isfinite(y).all(axis=(1, 2))
        slip, load, y, x = slip[kept], load[kept], y[kept], x[kept]
        readings = {"slip": slip, "load": load}
        bent = 2.0 * self.linear_torque * np.sinh(y[..., 0])
        torque = bent if self.linear_torque else np.exp(y[..., 0]) * load
        true = (torque, np.exp(y[..., 1]), y[..., 2] * load)
        told = rng.random((len(x), 1)) < SHARE_ALL_CHANNELS
        for name, value in zip(RESPONSE_CHANNELS, true, strict=True):
            noise = self.recipe.case.noise.get(column(name))
            read = (noise is not None) & (told | (name == "torque"))
            std = np.full_like(value, ABSENT_STD) if noise is None else noise.std(value)
            readings[name] = np.where(read, value + std * rng.standard_normal(std.shape), 1.0)
            readings[f"{name}_std"] = np.where(read, std, ABSENT_STD)
        bias = self.recipe.bias.get(column("torque"), Noise())
        readings["torque_bias"] = bias.std(true[0])
        readings["torque"] += readings["torque_bias"] * rng.standard_normal((len(x), 1))
        truth = [axis.value(x[:, i]) for i, axis in enumerate(self.axes[: self.targets])]
        sources = self.recipe.case.noise | {"torque_bias": bias}
        origin = Origin(
            designs=np.stack([slip, load], axis=-1),
            x=x,
            normal_std=np.zeros(len(x)),
            length=np.ones(len(x)),
            noise={
                name: (np.full_like(slip, own.constant), np.full_like(slip, own.share))
                for name in (*RESPONSE_CHANNELS, "torque_bias")
                if (own := sources.get(name if name == "torque_bias" else column(name)))
            },
        )
        return SimulatedSets(readings, {}, np.stack(truth, axis=1), origin)

    def metadata(self) -> dict[str, Any]:
        """See `Family`."""
        return {
            "kind": "one wheel",
            "slip": [self.recipe.slip.lower, self.recipe.slip.upper],
            "load": [self.recipe.load.lower, self.recipe.load.upper],
        }
