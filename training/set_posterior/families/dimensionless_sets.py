"""Designs and simulated sets of readings of wheels of any size."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.numerics.prior import Prior
from soilml.onboard.set_contract import ABSENT_READING, ABSENT_STD
from training.set_posterior.families.coordinates import NORMAL_TRUNCATION
from training.set_posterior.families.wheel_family import (
    Origin,
    SimulatedSets,
    WheelFamily,
    run_patterns,
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


def simulate_sets(
    family: WheelFamily, slip: Prior, count: int, rows: int, seed: int
) -> SimulatedSets:
    """Sets of a family, less those that leave the range of the response surface.

    Bearing values, wheel, noise and the bias of the torque sensor differ from set to set. Relative
    torque noise is 1 to 8 %; a third of the sets has a bias with a standard deviation of up to 4 %.
    The bearing curve is known exactly in a third of the sets, and up to a factor of 1.1 to 1.5 in
    the others.
    """
    rng = np.random.default_rng((seed, rows))
    base = family.designs(count, seed + rows)
    designs = np.repeat(base[:, None], rows, axis=1)
    designs[..., SLIP] = slip.at(run_patterns(count, rows, rng))
    designs[..., LOAD] *= np.exp(LOG_LOAD_RANGE * (run_patterns(count, rows, rng) - 0.5))
    x, bearing_std = _draw_unknowns(family, count, rng)
    y = family.responses(
        designs.reshape(-1, base.shape[1]), np.repeat(x, rows, axis=0)[:, None]
    ).reshape(count, rows, 3)
    in_range = _in_range(family, base, designs) & np.isfinite(y).all(axis=(1, 2))
    designs, y, x, bearing_std = designs[in_range], y[in_range], x[in_range], bearing_std[in_range]

    load, radius = designs[..., LOAD], designs[..., RADIUS]
    values = {
        "torque": np.exp(y[..., 0]) * load * radius,
        "sinkage": np.exp(y[..., 1]) * radius,
        "drawbar_pull": y[..., 2] * load,
    }
    readings, noise = _measure(values, designs, rng)
    context = {
        "wheel_radius": designs[:, 0, RADIUS],
        "wheel_width": designs[:, 0, WIDTH],
        "bearing_modulus": designs[:, 0, BEARING],
        "n": designs[:, 0, EXPONENT],
        "bearing_std": bearing_std,
        "cohesion_max": designs[:, 0, COHESION_MAX],
        "shear_modulus_max": designs[:, 0, SHEAR_MODULUS_MAX],
    }
    scales = (context["cohesion_max"], np.ones(len(x)), context["shear_modulus_max"])
    targets = zip(family.axes, scales, strict=False)
    truth = [scale * axis.value(x[:, i]) for i, (axis, scale) in enumerate(targets)]
    origin = Origin(designs, x, bearing_std / BEARING_RANGE, radius[:, 0], noise)
    return SimulatedSets(readings, context, np.stack(truth, axis=1), origin)


def _draw_unknowns(
    family: WheelFamily, count: int, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """Coordinates (count, p) of the prior, and `bearing_std` (count,)."""
    known = rng.random(count) < SHARE_KNOWN_BEARING
    bearing_std = np.where(known, 0.0, rng.uniform(LEAST_BEARING_STD, MOST_BEARING_STD, count))
    x = np.stack([a.quantile(rng.random(count)) for a in family.axes[: family.free]], axis=1)
    normal = np.clip(rng.standard_normal((count, 2)), -NORMAL_TRUNCATION, NORMAL_TRUNCATION)
    return np.concatenate([x, normal * bearing_std[:, None] / BEARING_RANGE], axis=1), bearing_std


def _in_range(family: WheelFamily, base: Floats, designs: Floats) -> NDArray[np.bool_]:
    """Whether all rows of a set have features within those of the designs (n, d), (sets,)."""
    sets, rows, width = designs.shape
    features = family.features(designs.reshape(-1, width)).reshape(sets, rows, -1)
    lower, upper = (end(family.features(base), axis=0) for end in (np.min, np.max))
    return np.asarray(((features > lower) & (features < upper)).all(axis=(1, 2)))


def _measure(
    values: dict[str, Floats], designs: Floats, rng: np.random.Generator
) -> tuple[dict[str, Floats], dict[str, tuple[Floats, Floats]]]:
    """Readings with noise, and their noise as in `Origin`, of true values (sets, rows)."""
    load, sets = designs[..., LOAD], len(designs)
    least, most = TORQUE_NOISE
    torque_noise = np.exp(rng.uniform(np.log(least), np.log(most), (sets, 1)))
    biased = rng.random((sets, 1)) < SHARE_BIASED
    bias = np.where(biased, rng.uniform(0.0, MOST_BIAS, (sets, 1)), 0.0)
    all_channels = rng.random((sets, 1)) < SHARE_ALL_CHANNELS
    stds = {
        "torque": torque_noise * values["torque"],
        "sinkage": SINKAGE_NOISE * values["sinkage"],
        "drawbar_pull": PULL_NOISE * load,
    }
    readings = {"slip": designs[..., SLIP], "load": load, "torque_bias": bias * values["torque"]}
    for name, value in values.items():
        measured = all_channels | (name == "torque")
        noisy = value + stds[name] * rng.standard_normal(value.shape)
        readings[name] = np.where(measured, noisy, ABSENT_READING)
        readings[f"{name}_std"] = np.where(measured, stds[name], ABSENT_STD)
    readings["torque"] += readings["torque_bias"] * rng.standard_normal((sets, 1))
    none = np.zeros_like(load)
    noise = {
        "torque": (none, torque_noise + none),
        "sinkage": (none, SINKAGE_NOISE + none),
        "drawbar_pull": (PULL_NOISE * load, none),
        "torque_bias": (none, bias + none),
    }
    return readings, noise
