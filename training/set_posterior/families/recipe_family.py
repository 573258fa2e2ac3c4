"""The wheel, or another gear, of a recipe: its operating conditions and the soils of its prior."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.stats import qmc

from datagen.recipe import Recipe
from soilml.arrays import Floats
from soilml.config.measurement_noise import Noise
from soilml.errors import InputError
from soilml.fitting.shared_errors import PULL_OFFSET_SHARE
from soilml.onboard.set_contract import OPERATING_NOISE, RESPONSE_CHANNELS
from soilml.physics.effects.base import Effect
from soilml.physics.operating_point import Operating
from soilml.quantities import column
from training.onnx_graph.value import Value, asinh, concat, log, maximum, sqrt
from training.set_posterior.families.coordinates import PriorAxis
from training.set_posterior.families.wheel_family import (
    MOST_RELATIVE_NOISE,
    SMALLEST,
    ContextValues,
    SimulatedSets,
    WheelFamily,
    add_log_torque,
    measured,
    run_patterns,
    typical_model_errors,
)

#: Up to this many unknowns the terms of a polynomial of the third degree (84) can be fitted.
MOST_UNKNOWNS = 6
#: Designs are drawn beyond the ends of both ranges by this share of their width, so that readings
#: at the ends are not extrapolated.
RANGE_MARGIN = 0.02
#: Share of simulated sets in which sinkage and drawbar pull are measured as well as torque.
SHARE_ALL_CHANNELS = 0.3
#: Up to this many unknowns all terms have a degree of up to four; beyond, those of the estimated
#: unknowns alone.
FEW_UNKNOWNS = 4
MOST_ROUNDS = 32  # Rounds in which simulated sets are drawn that their soils carry
LEAST_SHARE = 0.2  # Least relative noise in the scale of torque where its noise is constant
#: Without a logarithm, a torque is used whatever its noise; that of an absent reading is larger.
ANY_NOISE = 1e5


@dataclass(frozen=True)
class RecipeFamily(WheelFamily):
    """Gear and effects of a recipe on soils of its prior; a design is (slip, load)."""

    recipe: Recipe
    linear_torque: float = 0.0  # N m, below which the torque scale is nearly linear; 0: logarithm

    @staticmethod
    def of(recipe: Recipe, targets: Sequence[str]) -> RecipeFamily:
        """The family of a recipe.

        Raises `InputError` if the recipe has braking, covariates, stick-slip, a remainder, too many
        unknowns, or no prior of a target.
        """
        prior = recipe.case.prior
        names = [*targets, *(name for name in prior if name not in targets)]
        said = ""
        if missing := [name for name in targets if name not in prior]:
            said = f"no prior of {missing[0]}"
        elif recipe.case.remainder is not None:
            said = (
                "[remainder], an error of its model that the graph has no columns for; needed is a "
                "recipe without it, or a spec without [set_posterior], whose regressors learn it "
                "from the rows"
            )
        elif len(names) > MOST_UNKNOWNS:
            said = f"{len(names)} unknowns; needed are {MOST_UNKNOWNS} or fewer"
        elif recipe.slip.lower <= 0.0 or recipe.covariates or recipe.stick_slip:
            said = (
                "slip of 0 or less, covariates or stick-slip; needed are slip above 0 and torque "
                "that depends on slip, load and soil alone; remove [set_posterior] from the spec"
            )
        if said:
            raise InputError(f"set_posterior: the recipe has {said}")
        axes = tuple(PriorAxis.of(name, prior[name]) for name in names)
        degree = (4, 4) if len(axes) <= FEW_UNKNOWNS else (3, 4)
        family = RecipeFamily(axes, len(targets), len(axes), degree, recipe)
        noise = recipe.case.noise.get(column("torque"), Noise(share=1.0))
        if noise.constant == 0.0:
            return family
        return replace(family, linear_torque=noise.constant / max(noise.share, LEAST_SHARE))

    def designs(self, count: int, seed: int) -> Floats:
        """Slips and loads (count, 2)."""
        u = qmc.Sobol(2, rng=seed).random(1 << (count - 1).bit_length())[:count]
        u = u * (1.0 + 2.0 * RANGE_MARGIN) - RANGE_MARGIN
        slip = self.recipe.slip.at(u[:, 0])
        slip = np.clip(slip, 0.5 * self.recipe.slip.lower, 0.999)
        load = np.maximum(self.recipe.load.at(u[:, 1]), 0.5 * self.recipe.load.lower)
        return np.stack([slip, load], axis=1)

    def features(self, designs: Floats) -> Floats:
        """Logarithms of slip and load."""
        return np.log(designs)

    def responses(self, designs: Floats, x: Floats, *effects: Effect) -> Floats:
        r"""See `WheelFamily`; the length is 1 m.

        Torque is on a logarithmic scale, log(T / W), if its noise is relative, and else on the
        scale

        .. math:: \mathrm{asinh}(T / 2 T_0), \qquad T_0 = \sigma_{constant} / \sigma_{share}

        which stabilises the variance of noise with a constant and a relative part (Bartlett 1947).
        A relative part of at least a fifth is assumed: on a linear scale, torque is too far from a
        polynomial of the unknowns; and the noise computed from a reading is then within 5 % of
        that computed from the true torque.
        """
        case = self.recipe.case.with_values(
            {axis.name: axis.value(x[..., i]) for i, axis in enumerate(self.axes)}
        )
        slip, load = (designs[:, None, k] for k in (0, 1))
        model = replace(case.model, effects=(*case.model.effects, *effects))
        force = model(case.soil, Operating(slip=slip, load=load))
        with np.errstate(invalid="ignore", divide="ignore"):
            if self.linear_torque:
                torque = np.arcsinh(force.torque / (2.0 * self.linear_torque))
            else:
                torque = np.log(force.torque / load)
            return np.stack([torque, np.log(force.sinkage), force.drawbar_pull / load], axis=-1)

    def typical_errors(self) -> dict[str, float]:
        """See `WheelFamily`."""
        load = float(self.recipe.load.at(np.asarray(0.5)))
        return super().typical_errors() | {"drawbar_pull_bias": PULL_OFFSET_SHARE * load}

    def model_errors(self) -> dict[str, float]:
        """See `WheelFamily`."""
        return typical_model_errors([axis.name for axis in self.axes], self.recipe.case.model)

    def add_context(self, readings: dict[str, Value]) -> ContextValues:
        """See `WheelFamily`."""
        operating = concat([readings["slip"], readings["load"]], axis=0)
        torque, torque_slope = self._torque(readings)
        return ContextValues(
            features=log(maximum(operating, SMALLEST)),
            feature_slopes=np.eye(2),
            torque=torque,
            torque_slope=torque_slope,
            torque_by_load=0.0 if self.linear_torque else 1.0,
            reference_log_load=math.log(float(self.recipe.load.at(np.asarray(0.5)))),
            most_torque_noise=ANY_NOISE if self.linear_torque else MOST_RELATIVE_NOISE,
            length=1.0,
            target_scale=None,
            axis_std=None,
        )

    def _torque(self, readings: dict[str, Value]) -> tuple[Value, Value]:
        """Torque on the scale of the response, and the derivative of that scale, (1, rows)."""
        if not self.linear_torque:
            return add_log_torque(readings, 1.0)
        torque, twice = readings["torque"], 2.0 * self.linear_torque
        response = asinh(torque / twice)
        return response, 1.0 / sqrt(torque * torque + 4.0 * self.linear_torque**2)

    def sets(self, count: int, rows: int, seed: int) -> SimulatedSets:
        """See `WheelFamily`; the noise is the recipe's, and channels without noise are absent."""
        rng = np.random.default_rng((seed, rows))
        slip, load, y, x = self._carried_sets(count, rows, rng)
        asinh_torque = 2.0 * self.linear_torque * np.sinh(y[..., 0])
        torque = asinh_torque if self.linear_torque else np.exp(y[..., 0]) * load
        named = self._noise | {"torque_bias": self.recipe.bias.get(column("torque"), Noise())}
        noise = {
            name: np.stack([np.full(slip.shape, float(x)) for x in (own.constant, own.share)])
            for name, own in named.items()
        }
        values = [torque, np.exp(y[..., 1]), y[..., 2] * load]
        everything = rng.random((len(x), 1)) < SHARE_ALL_CHANNELS
        readings = {"slip": slip, "load": load} | measured(values, noise, everything, rng)
        designs, none = np.stack([slip, load], axis=-1), np.zeros(len(x))
        return SimulatedSets(readings, {}, self.truth(x), designs, x, none, none + 1.0, noise)

    @property
    def _noise(self) -> dict[str, Noise]:
        """Noise of the recipe by channel."""
        named = {name: self.recipe.case.noise.get(column(name)) for name in RESPONSE_CHANNELS}
        return {name: noise for name, noise in named.items() if noise}

    def _carried_sets(
        self, count: int, rows: int, rng: np.random.Generator
    ) -> tuple[Floats, Floats, Floats, Floats]:
        """Slip and load (count, rows), responses and soils of sets whose soil carries all rows.

        Those that it does not carry are drawn anew; after many rounds there may be fewer.
        """
        found: list[tuple[Floats, Floats, Floats, Floats]] = []
        for _ in range(MOST_ROUNDS):
            ranges = (self.recipe.slip, self.recipe.load)
            slip, load = (own.at(run_patterns(count, rows, rng)) for own in ranges)
            x = np.stack([axis.quantile(rng.random(count)) for axis in self.axes], axis=1)
            y = self.responses(
                np.stack([slip, load], axis=-1).reshape(-1, 2), np.repeat(x, rows, axis=0)[:, None]
            ).reshape(count, rows, 3)
            carried = np.isfinite(y).all(axis=(1, 2))
            found.append((slip[carried], load[carried], y[carried], x[carried]))
            if sum(len(one[3]) for one in found) >= count:
                break
        slip, load, y, x = (np.concatenate(part)[:count] for part in zip(*found, strict=True))
        return slip, load, y, x

    def declared_noise(self) -> dict[str, list[float]]:
        """Noise of the recipe as the file's own: constant part and share, by channel, and bias."""
        named = {name: self.recipe.case.noise.get(column(name)) for name in OPERATING_NOISE}
        named = {**self._noise, **named, "torque_bias": self.recipe.bias.get(column("torque"))}
        return {name: [noise.constant, noise.share] for name, noise in named.items() if noise}

    def metadata(self) -> dict[str, Any]:
        """See `WheelFamily`."""
        return {
            "kind": "one wheel",
            "slip": [self.recipe.slip.lower, self.recipe.slip.upper],
            "load": [self.recipe.load.lower, self.recipe.load.upper],
        }

    def described(self) -> str:
        """See `WheelFamily`."""
        operating = {"slip": self.recipe.slip, "load_N": self.recipe.load}
        said = [
            ", ".join(f"{name} {own.lower:g} to {own.upper:g}" for name, own in part.items())
            for part in (operating, self.recipe.case.prior)
        ]
        return f"{said[0]}, and [soil.prior] {said[1]}"
