"""Rigid wheels of any size under any load, on soils whose bearing values are context inputs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from soilml.arrays import Floats
from soilml.config.model_settings import take_prior
from soilml.io.toml_settings import Settings
from soilml.numerics.prior import Prior
from soilml.physics.contact import Force
from soilml.physics.effects.base import Effect
from soilml.physics.gears import Wheel
from soilml.physics.model import Model
from soilml.physics.operating_point import Operating
from soilml.physics.soils import Soil
from training.onnx_graph.value import Value, concat, constant, gemm, log, maximum
from training.set_posterior.families.coordinates import NORMAL_TRUNCATION, PriorAxis
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

#: Columns of a design: slip, radius (m), width (m), load (N), exponent n, bearing modulus
#: (N/m^(n+2)), largest cohesion (Pa) and largest shear modulus (m) of the prior.
SLIP, RADIUS, WIDTH, LOAD, EXPONENT, BEARING, COHESION_MAX, SHEAR_MODULUS_MAX = range(8)

#: Priors of cohesion and shear modulus as shares of their largest values. Below a sixth of it,
#: torque hardly depends on the shear modulus.
COHESION_SHARE, SHEAR_MODULUS_SHARE = Prior(0.0, 1.0), Prior(1.0 / 6.0, 1.0)

#: Two nuisance parameters are deviations of the bearing curve from its context inputs: of the
#: logarithm of pressure at the reference depth, and of the exponent n. A coordinate of 1 is a
#: deviation by these.
BEARING_RANGE, EXPONENT_RANGE = 1.0, 0.25
#: Depth over wheel radius at which the two deviations are independent: a typical sinkage.
REFERENCE_DEPTH = 0.05
#: Largest `bearing_std`: the range is `NORMAL_TRUNCATION` = 2.5 of these standard deviations.
MOST_BEARING_STD = 0.4
#: Stands for a standard deviation of zero, of which the logarithm is taken (of the coordinate).
LEAST_NORMAL_STD = 1e-3


#: Loads of one set differ by up to this much in their logarithm: a factor of 3.3.
LOG_LOAD_RANGE = 1.2
#: Share of sets whose bearing curve is known exactly; the others have at least this `bearing_std`.
SHARE_KNOWN_BEARING, LEAST_BEARING_STD = 1.0 / 3.0, 0.1
#: Relative noise of torque, log-uniform; relative noise of sinkage, and of drawbar pull over load.
TORQUE_NOISE, SINKAGE_NOISE, PULL_NOISE = (0.01, 0.08), 0.05, 0.03
#: Share of sets with a bias of the torque sensor, and the largest standard deviation of the bias.
SHARE_BIASED, MOST_BIAS = 1.0 / 3.0, 0.04
SHARE_ALL_CHANNELS = 0.3  # Share of sets in which sinkage and drawbar pull are measured as well
#: Designs are drawn beyond the ends of every range by this share of its width, so that readings at
#: the ends are not extrapolated.
RANGE_MARGIN = 0.02
#: Designs that are drawn and tested at a time; a power of two keeps the Sobol sequence balanced.
CANDIDATES = 1 << 13
#: Ranges of a spec that designs are drawn from, and context inputs of the graph with their units.
RANGES = (
    *("slip", "wheel_radius", "width_over_radius", "load", "n", "pressure_at_1cm"),
    *("cohesion_max", "shear_modulus_max"),
)
CONTEXT = {
    "wheel_radius": "m",
    "wheel_width": "m",
    "bearing_modulus": "N/m^(n+2)",
    "n": "1",
    "bearing_std": "1",
    "cohesion_max": "Pa",
    "shear_modulus_max": "m",
}


@dataclass(frozen=True)
class DimensionlessFamily(WheelFamily):
    """Ranges of wheels, loads and bearing values; a design is (s, r, b, W, n, k, c max, K max).

    The response surface has no dimensions. With k the bearing modulus k_c / b + k_phi, torque over
    load and radius depends on slip, W / (k b r^(n+1)), c r b / W, phi, K / r and n alone (Wong and
    Reece 1967, divided by r, W and k): one response surface serves wheels of all sizes.
    """

    ranges: dict[str, Prior]
    sinkage: tuple[float, float]  # range of sinkage over radius of the designs
    pressure: tuple[float, float]  # range of load / (radius width) of the designs, Pa

    @staticmethod
    def take(settings: Settings) -> DimensionlessFamily:
        """Read `[any_wheel]` of a spec."""
        others = ("friction_angle", "sinkage_over_radius", "ground_pressure")
        ranges = {name: take_prior(settings, name) for name in RANGES}
        angle, sinkage, pressure = (take_prior(settings, name) for name in others)
        settings.finish()
        priors = {
            "cohesion": COHESION_SHARE,
            "friction_angle": angle,
            "shear_modulus": SHEAR_MODULUS_SHARE,
            "log_bearing_deviation": Prior(-BEARING_RANGE, BEARING_RANGE),
            "exponent_deviation": Prior(-EXPONENT_RANGE, EXPONENT_RANGE),
        }
        axes = tuple(PriorAxis.of(name, prior) for name, prior in priors.items())
        ends = ((own.lower, own.upper) for own in (sinkage, pressure))
        return DimensionlessFamily(axes, 3, 3, (3, 4), ranges, *ends)

    def designs(self, count: int, seed: int) -> Floats:
        """Operating conditions (count, 8) whose sinkage and ground pressure are in range.

        Sinkage is that on soil in the middle of the prior.
        """
        sequence = qmc.Sobol(len(self.ranges), rng=seed)
        accepted: list[Floats] = []
        while sum(map(len, accepted)) < count:
            u = sequence.random(CANDIDATES) * (1.0 + 2.0 * RANGE_MARGIN) - RANGE_MARGIN
            designs = self._designs_at(u)
            middle = np.zeros((len(designs), 1, len(self.axes)))
            sinkage = np.exp(self.responses(designs, middle)[:, 0, 1])
            accepted.append(designs[(sinkage > self.sinkage[0]) & (sinkage < self.sinkage[1])])
        return np.concatenate(accepted)[:count]

    def _designs_at(self, u: Floats) -> Floats:
        """Designs at fractions u (n, ranges) of the ranges whose ground pressure is in range."""
        named = {name: prior.at(u[:, i]) for i, (name, prior) in enumerate(self.ranges.items())}
        radius, load, n = named["wheel_radius"], named["load"], named["n"]
        width = radius * named["width_over_radius"]
        bearing = named["pressure_at_1cm"] / 0.01**n
        prior = (named["cohesion_max"], named["shear_modulus_max"])
        designs = np.stack([named["slip"], radius, width, load, n, bearing, *prior], axis=1)
        pressure = load / (radius * width)
        return designs[(pressure > self.pressure[0]) & (pressure < self.pressure[1])]

    def features(self, designs: Floats) -> Floats:
        """Logarithms of slip, load number, largest cohesion and shear modulus; and n."""
        slip, r, b, load, n, k, c_max, shear_max = designs.T
        load_number = np.log(load / (k * b)) - (n + 1.0) * np.log(r)
        others = (np.log(c_max * r * b / load), np.log(shear_max / r), n)
        return np.stack([np.log(slip), load_number, *others], axis=1)

    def force(self, designs: Floats, x: Floats, *effects: Effect) -> Force:
        """Forces of the wheel (n, m), with effects, on soils at coordinates x (n, m, p)."""
        slip, r, b, load, n, k, c_max, shear_max = designs[:, None, :].transpose(2, 0, 1)
        c, phi, shear, log_bearing, exponent = (a.value(x[..., i]) for i, a in enumerate(self.axes))
        soil = Soil(
            cohesion=c_max * c,
            friction_angle=phi,
            shear_modulus=shear_max * shear,
            kc=0.0,
            kphi=k * np.exp(log_bearing) * (REFERENCE_DEPTH * r) ** -exponent,
            n=n + exponent,
        )
        return Model(Wheel(radius=r, width=b), effects)(soil, Operating(slip=slip, load=load))

    def responses(self, designs: Floats, x: Floats, *effects: Effect) -> Floats:
        """See `WheelFamily`; torque as the logarithm of T / (W r), and the length is the radius."""
        force = self.force(designs, x, *effects)
        r, load = designs[:, RADIUS, None], designs[:, LOAD, None]
        with np.errstate(invalid="ignore", divide="ignore"):
            torque, sinkage = np.log(force.torque / (load * r)), np.log(force.sinkage / r)
        return np.stack([torque, sinkage, force.drawbar_pull / load], axis=-1)

    def inputs(self) -> dict[str, str]:
        """See `WheelFamily`."""
        return CONTEXT

    def limits(self) -> dict[str, list[float]]:
        """See `WheelFamily`; combinations of values within them may still be out of range."""
        ends = {name: [own.lower, own.upper] for name, own in self.ranges.items()}
        r, share, n, p1 = (ends[name] for name in (*RANGES[1:3], *RANGES[4:6]))
        ends["wheel_width"] = [r[k] * share[k] for k in (0, 1)]
        ends["bearing_modulus"] = [p1[k] / 0.01 ** n[k] for k in (0, 1)]
        ends["bearing_std"] = [0.0, MOST_BEARING_STD]
        return {name: ends[name] for name in CONTEXT}

    def model_errors(self) -> dict[str, float]:
        """See `WheelFamily`; `bearing_std` is the error of the bearing curve."""
        return typical_model_errors(["cohesion", "kphi", "n"], Model(Wheel(radius=1.0, width=1.0)))

    def add_context(self, readings: dict[str, Value]) -> ContextValues:
        """See `WheelFamily`; features are linear in the logarithms of the inputs."""
        graph, radius, n = readings["slip"].graph, readings["wheel_radius"], readings["n"]
        most = MOST_BEARING_STD / BEARING_RANGE
        normal_std = (readings["bearing_std"] / BEARING_RANGE).clip(LEAST_NORMAL_STD, most)
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
        shared = of_context.T @ concat([log_context, n, n_log_radius], axis=0).reshape(-1, 1)
        operating = concat([readings["slip"], readings["load"]], axis=0)
        log_operating = log(maximum(operating, SMALLEST))
        of_operating = np.asarray([[1.0, 0.0, 0.0, 0.0, 0.0], [0.0, 1.0, -1.0, 0.0, 0.0]])
        torque, torque_slope = add_log_torque(readings, radius)
        features = gemm(constant(graph, of_operating.T), log_operating, shared)
        target_scale = concat([readings[scales[0]], one, readings[scales[1]]], axis=0)
        middle_pressure = float(np.mean(np.log(self.pressure)))
        return ContextValues(
            features=features,
            feature_slopes=of_operating,
            torque=torque,
            torque_slope=torque_slope,
            torque_by_load=1.0,
            reference_log_load=log(radius * readings["wheel_width"]) + middle_pressure,
            most_torque_noise=MOST_RELATIVE_NOISE,
            length=radius,
            target_scale=target_scale,
            axis_std=concat([one, one, one, normal_std, normal_std], axis=0).reshape(-1, 1),
        )

    def metadata(self) -> dict[str, Any]:
        """See `WheelFamily`."""
        return {
            "kind": "any wheel",
            **{name: prior.as_setting() for name, prior in self.ranges.items()},
            "friction_angle": list(self.axes[1].ends),
            "sinkage_over_radius": list(self.sinkage),
            "ground_pressure": list(self.pressure),
            "bearing_std": [0.0, MOST_BEARING_STD],
        }

    def sets(self, count: int, rows: int, seed: int) -> SimulatedSets:
        """See `WheelFamily`; sets that leave the range of the response surface are left out.

        Bearing values, wheel, noise and the bias of the torque sensor differ from set to set.
        Relative torque noise is 1 to 8 %; a third of the sets has a bias with a standard deviation
        of up to 4 %. The bearing curve is known exactly in a third of the sets, and up to a factor
        of 1.1 to 1.5 in the others.
        """
        rng = np.random.default_rng((seed, rows))
        base = self.designs(count, seed + rows)
        designs = np.repeat(base[:, None], rows, axis=1)
        designs[..., SLIP] = self.ranges["slip"].at(run_patterns(count, rows, rng))
        designs[..., LOAD] *= np.exp(LOG_LOAD_RANGE * (run_patterns(count, rows, rng) - 0.5))
        x, bearing_std = self._draw_unknowns(count, rng)
        flat = designs.reshape(-1, base.shape[1])
        y = self.responses(flat, np.repeat(x, rows, axis=0)[:, None]).reshape(count, rows, 3)
        lower, upper = (end(self.features(base), axis=0) for end in (np.min, np.max))
        features = self.features(flat).reshape(count, rows, -1)
        kept = ((features > lower) & (features < upper)).all(axis=(1, 2))
        kept &= np.isfinite(y).all(axis=(1, 2))
        designs, y, x, bearing_std = designs[kept], y[kept], x[kept], bearing_std[kept]
        load, radius = designs[..., LOAD], designs[..., RADIUS]
        values = [np.exp(y[..., 0]) * load * radius, np.exp(y[..., 1]) * radius, y[..., 2] * load]
        noise, everything = _noise(load, rng)
        readings = {"slip": designs[..., SLIP], "load": load}
        readings |= measured(values, noise, everything, rng)
        columns = (RADIUS, WIDTH, BEARING, EXPONENT, None, COHESION_MAX, SHEAR_MODULUS_MAX)
        context = {
            name: bearing_std if k is None else designs[:, 0, k]
            for name, k in zip(CONTEXT, columns, strict=True)
        }
        truth = self.truth(x, (context["cohesion_max"], 1.0, context["shear_modulus_max"]))
        normal_std = bearing_std / BEARING_RANGE
        return SimulatedSets(readings, context, truth, designs, x, normal_std, radius[:, 0], noise)

    def _draw_unknowns(self, count: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
        """Coordinates (count, p) of the prior, and `bearing_std` (count,)."""
        known = rng.random(count) < SHARE_KNOWN_BEARING
        std = np.where(known, 0.0, rng.uniform(LEAST_BEARING_STD, MOST_BEARING_STD, count))
        x = np.stack([a.quantile(rng.random(count)) for a in self.axes[: self.free]], axis=1)
        normal = np.clip(rng.standard_normal((count, 2)), -NORMAL_TRUNCATION, NORMAL_TRUNCATION)
        return np.concatenate([x, normal * std[:, None] / BEARING_RANGE], axis=1), std

    def described(self) -> str:
        """See `WheelFamily`."""
        said = (f"{name} {own.lower:g} to {own.upper:g}" for name, own in self.ranges.items())
        return f"[any_wheel] {', '.join(said)}"


def _noise(load: Floats, rng: np.random.Generator) -> tuple[dict[str, Floats], NDArray[np.bool_]]:
    """Noise as in `SimulatedSets`, and which sets (sets, 1) have all channels."""
    least, most = TORQUE_NOISE
    shape = (len(load), 1)
    torque = np.exp(rng.uniform(np.log(least), np.log(most), shape))
    biased = rng.random(shape) < SHARE_BIASED
    bias = np.where(biased, rng.uniform(0.0, MOST_BIAS, shape), 0.0)
    everything = rng.random(shape) < SHARE_ALL_CHANNELS
    none = np.zeros_like(load)
    noise = {
        "torque": np.stack([none, torque + none]),
        "sinkage": np.stack([none, SINKAGE_NOISE + none]),
        "drawbar_pull": np.stack([PULL_NOISE * load, none]),
        "torque_bias": np.stack([none, bias + none]),
    }
    return noise, everything
