"""Rigid wheels of any size under any load, on soils whose bearing values are context inputs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
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
from training.set_posterior.families.coordinates import PriorAxis
from training.set_posterior.families.dimensionless_sets import (
    BEARING_RANGE,
    COHESION_SHARE,
    EXPONENT_RANGE,
    LEAST_NORMAL_STD,
    LOAD,
    MOST_BEARING_STD,
    RADIUS,
    REFERENCE_DEPTH,
    SHEAR_MODULUS_SHARE,
    simulate_sets,
)
from training.set_posterior.families.wheel_family import (
    MOST_RELATIVE_NOISE,
    SMALLEST,
    TYPICAL_ERRORS,
    ContextValues,
    SimulatedSets,
    add_log_torque,
    typical_contact,
    typical_model_errors,
)

#: Designs are drawn beyond the ends of every range by this share of its width, so that readings at
#: the ends are not extrapolated.
RANGE_MARGIN = 0.02
#: Designs that are drawn and tested at a time; a power of two keeps the Sobol sequence balanced.
CANDIDATES = 1 << 13


@dataclass(frozen=True)
class DimensionlessFamily:
    """Ranges of wheels, loads and bearing values; a design is (s, r, b, W, n, k, c max, K max).

    The response surface has no dimensions. With k the bearing modulus k_c / b + k_phi, torque over
    load and radius depends on slip, W / (k b r^(n+1)), c r b / W, phi, K / r and n alone (Wong and
    Reece 1967, divided by r, W and k): one response surface serves wheels of all sizes.
    """

    ranges: dict[str, Prior]
    sinkage: tuple[float, float]  # range of sinkage over radius of the designs
    pressure: tuple[float, float]  # range of load / (radius width) of the designs, Pa
    axes: tuple[PriorAxis, ...]
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
                PriorAxis.of("cohesion", COHESION_SHARE),
                PriorAxis.of("friction_angle", angle),
                PriorAxis.of("shear_modulus", SHEAR_MODULUS_SHARE),
                PriorAxis.of("log_bearing_deviation", Prior(-BEARING_RANGE, BEARING_RANGE)),
                PriorAxis.of("exponent_deviation", Prior(-EXPONENT_RANGE, EXPONENT_RANGE)),
            ),
        )

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
        return np.stack(
            [
                np.log(slip),
                np.log(load / (k * b)) - (n + 1.0) * np.log(r),
                np.log(c_max * r * b / load),
                np.log(shear_max / r),
                n,
            ],
            axis=1,
        )

    def sets(self, count: int, rows: int, seed: int) -> SimulatedSets:
        """See `WheelFamily` and `simulate_sets`."""
        return simulate_sets(self, self.ranges["slip"], count, rows, seed)

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

    def responses(self, designs: Floats, x: Floats) -> Floats:
        """See `WheelFamily`; torque as the logarithm of T / (W r), and the length is the radius."""
        return self._responses(designs, x)

    def _responses(self, designs: Floats, x: Floats, *effects: Effect) -> Floats:
        force = self.force(designs, x, *effects)
        r, load = designs[:, RADIUS, None], designs[:, LOAD, None]
        with np.errstate(invalid="ignore", divide="ignore"):
            torque, sinkage = np.log(force.torque / (load * r)), np.log(force.sinkage / r)
        return np.stack([torque, sinkage, force.drawbar_pull / load], axis=-1)

    def inputs(self) -> dict[str, str]:
        """Context inputs and their units."""
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
        """See `WheelFamily`; combinations of values within them may still be out of range."""
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

    def typical_errors(self) -> dict[str, float]:
        """See `WheelFamily`; none of drawbar pull, as loads differ by a factor of a thousand."""
        return TYPICAL_ERRORS

    def model_errors(self) -> dict[str, float]:
        """See `WheelFamily`; `bearing_std` is the error of the bearing curve."""
        return typical_model_errors(["cohesion", "kphi", "n"], Model(Wheel(radius=1.0, width=1.0)))

    def contact_changes(self, designs: Floats, x: Floats) -> Floats:
        """See `WheelFamily`."""
        return self._responses(designs, x, typical_contact()) - self._responses(designs, x)

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
        return ContextValues(
            features=features,
            feature_slopes=of_operating,
            torque=torque,
            torque_slope=torque_slope,
            torque_by_load=1.0,
            reference_log_load=log(radius * readings["wheel_width"]) + self._middle_pressure,
            most_torque_noise=MOST_RELATIVE_NOISE,
            length=radius,
            target_scale=target_scale,
            axis_std=concat([one, one, one, normal_std, normal_std], axis=0).reshape(-1, 1),
        )

    @property
    def _middle_pressure(self) -> float:
        """Logarithm of a ground pressure (Pa) in the middle of the range."""
        return float(np.mean(np.log(self.pressure)))

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

    def described(self) -> str:
        """See `WheelFamily`."""
        said = (f"{name} {own.lower:g} to {own.upper:g}" for name, own in self.ranges.items())
        return f"[any_wheel] {', '.join(said)}"
