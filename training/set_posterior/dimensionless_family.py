"""Rigid wheels of any size under any load: how they are driven, and on which soils."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from soilml.config.prior import take_prior
from soilml.io.toml_settings import Settings
from soilml.numerics.prior import Prior
from soilml.onboard.set_contract import ABSENT_STD
from soilml.physics.contact import Force
from soilml.physics.gears import Wheel
from soilml.physics.model import Model
from soilml.physics.operating_point import Operating
from soilml.physics.soils import Soil
from training.onnx_graph.value import Value, concat, constant, gemm, log, maximum
from training.set_posterior.coordinates import Coordinate
from training.set_posterior.response_surface import NORMAL_TRUNCATION
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

#: Estimated axes, as shares of the largest cohesion and shear modulus; and the friction angle.
COHESION, SHEAR_MODULUS = Prior(0.0, 1.0), Prior(1.0 / 6.0, 1.0)
#: The bearing curve is given, and strays from what is given: its logarithm at the pivot by up to
#: this much, and its exponent by up to that; the widest standard deviation is 1 / 2.5 of it.
BEARING_RANGE, EXPONENT_RANGE = 1.0, 0.25
MOST_BEARING_STD = 0.4
LEAST_NORMAL_STD = 1e-3
#: The curve pivots at this share of the radius.
REFERENCE_DEPTH = 0.05
#: Margin of every range in which designs are drawn, as a share of its width.
RANGE_MARGIN = 0.02
#: Loads of one set differ by up to this much in their logarithm.
LOAD_SPREAD = 1.2
#: Order of a design's numbers.
SLIP, RADIUS, WIDTH, LOAD, EXPONENT, BEARING, MOST_COHESION, MOST_SHEAR_MODULUS = range(8)


@dataclass(frozen=True)
class DimensionlessFamily:
    """Ranges of wheels, loads and bearing values; a design is (s, r, b, W, n, k, c max, K max).

    Everything is learned without dimensions. With k the bearing modulus k_c / b + k_phi, torque
    over load and radius depends on slip, W / (k b r^(n+1)), c r b / W, phi, K / r and n alone
    (Wong and Reece 1967 written over r, W and k): one response serves wheels of all sizes.
    """

    ranges: dict[str, Prior]
    sinkage: tuple[float, float]  # over radius, of what is learned from
    pressure: tuple[float, float]  # load / (radius width), Pa, likewise
    axes: tuple[Coordinate, ...]
    targets: int = 3
    free: int = 3
    degree: tuple[int, int] = (3, 4)

    @staticmethod
    def take(settings: Settings) -> DimensionlessFamily:
        """Read `[any_wheel]` of a spec."""
        names = (
            "slip",
            "wheel_radius",
            "width_over_radius",
            "load",
            "n",
            "pressure_at_1cm",
            "cohesion_max",
            "shear_modulus_max",
        )
        ranges = {name: take_prior(settings, name) for name in names}
        angle = take_prior(settings, "friction_angle")
        sinkage, pressure = (
            take_prior(settings, "sinkage_over_radius"),
            take_prior(settings, "ground_pressure"),
        )
        settings.finish()
        return DimensionlessFamily(
            ranges,
            (sinkage.lower, sinkage.upper),
            (pressure.lower, pressure.upper),
            (
                Coordinate.of("cohesion", COHESION),
                Coordinate.of("friction_angle", angle),
                Coordinate.of("shear_modulus", SHEAR_MODULUS),
                Coordinate.of("bearing", Prior(-BEARING_RANGE, BEARING_RANGE)),
                Coordinate.of("bend", Prior(-EXPONENT_RANGE, EXPONENT_RANGE)),
            ),
        )

    def designs(self, count: int, seed: int) -> Floats:
        """Ways to drive (count, 8) whose load the middle of the soils carries, as asked for."""
        sequence = qmc.Sobol(len(self.ranges), rng=seed)
        found: list[Floats] = []
        have = 0
        while have < count:
            u = sequence.random(1 << 13) * (1.0 + 2.0 * RANGE_MARGIN) - RANGE_MARGIN
            named = {name: prior.at(u[:, i]) for i, (name, prior) in enumerate(self.ranges.items())}
            radius, load, n = named["wheel_radius"], named["load"], named["n"]
            width = radius * named["width_over_radius"]
            bearing = named["pressure_at_1cm"] / 0.01**n
            prior = (named["cohesion_max"], named["shear_modulus_max"])
            drawn = np.stack([named["slip"], radius, width, load, n, bearing, *prior], axis=1)
            pressure = load / (radius * width)
            drawn = drawn[(pressure > self.pressure[0]) & (pressure < self.pressure[1])]
            middle = np.zeros((len(drawn), 1, len(self.axes)))
            depth = np.exp(self.responses(drawn, middle)[:, 0, 1])
            held = (depth > self.sinkage[0]) & (depth < self.sinkage[1])
            found.append(drawn[held])
            have += int(held.sum())
        return np.concatenate(found)[:count]

    def features(self, designs: Floats) -> Floats:
        """Logarithms of slip, load number, largest cohesion and shear modulus; and n."""
        slip, r, b, load, n, k, most_c, most_shear = designs.T
        return np.stack(
            [
                np.log(slip),
                np.log(load / (k * b)) - (n + 1.0) * np.log(r),
                np.log(most_c * r * b / load),
                np.log(most_shear / r),
                n,
            ],
            axis=1,
        )

    def sets(self, count: int, rows: int, seed: int) -> SimulatedSets:
        """See `Family`; bearing, wheel, noise and the torque sensor's bias differ from set to set.

        Torque strays by 1 to 8 %, in a third of the sets by up to 4 % more that all rows share; the
        bearing curve is known in a third, and known up to a factor of 1.1 to 1.5 in the others.
        """
        rng = np.random.default_rng((seed, rows))
        base = self.designs(count, seed + rows)
        designs = np.repeat(base[:, None], rows, axis=1)
        designs[..., SLIP] = self.ranges["slip"].at(run_patterns(count, rows, rng))
        designs[..., LOAD] *= np.exp(LOAD_SPREAD * (run_patterns(count, rows, rng) - 0.5))
        near = np.where(
            rng.random(count) < 1.0 / 3.0, 0.0, rng.uniform(0.1, MOST_BEARING_STD, count)
        )
        x = np.stack([a.quantile(rng.random(count)) for a in self.axes[: self.free]], axis=1)
        stray = (
            np.clip(rng.standard_normal((count, 2)), -NORMAL_TRUNCATION, NORMAL_TRUNCATION)
            * near[:, None]
            / BEARING_RANGE
        )
        x = np.concatenate([x, stray], axis=1)
        flat = designs.reshape(-1, base.shape[1])
        y = self.responses(flat, np.repeat(x, rows, axis=0)[:, None]).reshape(count, rows, 3)
        z = self.features(flat).reshape(count, rows, -1)
        lower, upper = (end(self.features(base), axis=0) for end in (np.min, np.max))
        kept = np.isfinite(y).all(axis=(1, 2)) & ((z > lower) & (z < upper)).all(axis=(1, 2))
        designs, y, x, near = designs[kept], y[kept], x[kept], near[kept]
        n, load, radius = len(x), designs[..., LOAD], designs[..., RADIUS]
        torque, sinkage = np.exp(y[..., 0]) * load * radius, np.exp(y[..., 1]) * radius
        share = np.exp(rng.uniform(np.log(0.01), np.log(0.08), (n, 1)))
        bias = np.where(rng.random((n, 1)) < 1.0 / 3.0, rng.uniform(0.0, 0.04, (n, 1)), 0.0)
        told = rng.random((n, 1)) < 0.3
        stds = {"torque": share * torque, "sinkage": 0.05 * sinkage, "drawbar_pull": 0.03 * load}
        readings = {"slip": designs[..., SLIP], "load": load, "torque_bias": bias * torque}
        for name, value in zip(stds, (torque, sinkage, y[..., 2] * load), strict=True):
            read = told | (name == "torque")
            noisy = value + stds[name] * rng.standard_normal(value.shape)
            readings[name] = np.where(read, noisy, 1.0)
            readings[f"{name}_std"] = np.where(read, stds[name], ABSENT_STD)
        readings["torque"] += readings["torque_bias"] * rng.standard_normal((n, 1))
        scale = (designs[:, 0, MOST_COHESION], np.ones(n), designs[:, 0, MOST_SHEAR_MODULUS])
        names = ("wheel_radius", "wheel_width", "bearing_modulus", "n")
        places = (RADIUS, WIDTH, BEARING, EXPONENT)
        context = {k: designs[:, 0, i] for k, i in zip(names, places, strict=True)}
        context |= {"bearing_std": near, "cohesion_max": scale[0], "shear_modulus_max": scale[2]}
        truth = [
            s * a.value(x[:, i]) for i, (a, s) in enumerate(zip(self.axes, scale, strict=False))
        ]
        none = np.zeros_like(load)
        noise = {
            "torque": (none, share + none),
            "sinkage": (none, 0.05 + none),
            "drawbar_pull": (0.03 * load, none),
            "torque_bias": (none, bias + none),
        }
        origin = Origin(designs, x, near / BEARING_RANGE, radius[:, 0], noise)
        return SimulatedSets(readings, context, np.stack(truth, axis=1), origin)

    def force(self, designs: Floats, x: Floats) -> Force:
        """What the wheel does (n, m) on soils at coordinates x (n, m, p)."""
        slip, r, b, load, n, k, most_c, most_shear = designs[:, None, :].transpose(2, 0, 1)
        c, phi, shear, stray, bend = (a.value(x[..., i]) for i, a in enumerate(self.axes))
        soil = Soil(
            cohesion=most_c * c,
            friction_angle=phi,
            shear_modulus=most_shear * shear,
            kc=0.0,
            kphi=k * np.exp(stray) * (REFERENCE_DEPTH * r) ** -bend,
            n=n + bend,
        )
        return Model(Wheel(radius=r, width=b))(soil, Operating(slip=slip, load=load))

    def responses(self, designs: Floats, x: Floats) -> Floats:
        """See `Family`; torque as the logarithm of T / (W r), and the length is the radius."""
        force = self.force(designs, x)
        r, load = designs[:, RADIUS, None], designs[:, LOAD, None]
        with np.errstate(invalid="ignore", divide="ignore"):
            torque, depth = np.log(force.torque / (load * r)), np.log(force.sinkage / r)
        return np.stack([torque, depth, force.drawbar_pull / load], axis=-1)

    def inputs(self) -> dict[str, str]:
        """What holds for all rows of a set."""
        return {
            "wheel_radius": "m",
            "wheel_width": "m",
            "bearing_modulus": "N/m^(n+2)",
            "n": "1",
            "bearing_std": "1",
            "cohesion_max": "Pa",
            "shear_modulus_max": "m",
        }

    def limits(self) -> dict[str, list[float]]:
        """Least and most of each of `inputs`; together they may be outside of what is learned."""
        r, share, n, p1, c, shear = (
            (self.ranges[name].lower, self.ranges[name].upper)
            for name in (
                "wheel_radius",
                "width_over_radius",
                "n",
                "pressure_at_1cm",
                "cohesion_max",
                "shear_modulus_max",
            )
        )
        return {
            "wheel_radius": list(r),
            "wheel_width": [r[0] * share[0], r[1] * share[1]],
            "bearing_modulus": [p1[0] / 0.01 ** n[0], p1[1] / 0.01 ** n[1]],
            "n": list(n),
            "bearing_std": [0.0, MOST_BEARING_STD],
            "cohesion_max": list(c),
            "shear_modulus_max": list(shear),
        }

    def add_context(self, readings: dict[str, Value]) -> ContextValues:
        """See `WheelFamily`; features are linear in the logarithms of the inputs."""
        graph, radius, n = readings["slip"].graph, readings["wheel_radius"], readings["n"]
        normal_std = maximum(readings["bearing_std"] / BEARING_RANGE, LEAST_NORMAL_STD)
        one = constant(graph, np.ones(1))
        scales = ("cohesion_max", "shear_modulus_max")
        context = ("wheel_radius", "wheel_width", "bearing_modulus", *scales)
        log_context = log(concat([readings[name] for name in context], axis=0))
        n_log_radius = n * log(radius)
        # rows: the logarithms of r, b, k, c max, K max, then n and n log r; columns: the features
        of_context = np.zeros((7, 5))
        of_context[:, 1] = [-1.0, -1.0, -1.0, 0.0, 0.0, 0.0, -1.0]
        of_context[:, 2] = [1.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0]
        of_context[:, 3] = [-1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0]
        of_context[5, 4] = 1.0
        shared = concat([log_context, n, n_log_radius], axis=0) @ of_context
        operating = concat([readings["slip"], readings["load"]], axis=0)
        log_operating = log(maximum(operating, SMALLEST)).reshape(2, -1)
        of_operating = np.asarray([[1.0, 0.0, 0.0, 0.0, 0.0], [0.0, 1.0, -1.0, 0.0, 0.0]])
        torque, torque_slope = add_log_torque(readings, radius)
        features = gemm(log_operating, of_operating, shared, transpose_a=True)
        target_scale = concat([readings[scales[0]], one, readings[scales[1]]], axis=0)
        return ContextValues(
            features=features,
            torque=torque,
            torque_slope=torque_slope,
            most_torque_noise=MOST_RELATIVE_NOISE,
            length=radius,
            target_scale=target_scale.reshape(-1, 1),
            axis_std=concat([one, one, one, normal_std, normal_std], axis=0).reshape(-1, 1),
        )

    def metadata(self) -> dict[str, Any]:
        """See `Family`."""
        return {
            "kind": "any wheel",
            **{name: prior.as_setting() for name, prior in self.ranges.items()},
            "friction_angle": list(self.axes[1].ends),
            "sinkage_over_radius": list(self.sinkage),
            "ground_pressure": list(self.pressure),
            "bearing_std": [0.0, MOST_BEARING_STD],
        }
