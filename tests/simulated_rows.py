"""Rows of rovers on random soils, with noise, for wheels of one size or any."""

from __future__ import annotations

import numpy as np

from soilml import Model, Operating, Soil, Wheel
from soilml.onboard.set_contract import OPTIONAL_READINGS

#: The wheel and the bearing values of `exported/wheel.onnx`.
REFERENCE = {
    "wheel_radius": 0.15, "wheel_width": 0.12, "n": 1.1,
    "cohesion_max": 3000.0, "shear_modulus_max": 0.03,
}  # fmt: skip
#: What `any_wheel.onnx` needs to know of a wheel on dry sand.
ANY_WHEEL = REFERENCE | {"bearing_modulus": 1.5e6, "bearing_std": 0.1}
KC, KPHI = 990.0, 1528.43e3


def context_of(rng):
    """A wheel, its ground and the ends of the prior, in the range of `any_wheel.onnx`."""
    radius = float(np.exp(rng.uniform(*np.log([0.06, 0.4]))))
    n = rng.uniform(0.6, 1.3)
    return {
        "wheel_radius": radius,
        "wheel_width": radius * rng.uniform(0.4, 1.4),
        "bearing_modulus": float(np.exp(rng.uniform(*np.log([4e3, 4e4])))) / 0.01**n,
        "n": n,
        "bearing_std": rng.choice([0.0, 0.2]),
        "cohesion_max": rng.uniform(1000.0, 5000.0),
        "shear_modulus_max": rng.uniform(0.015, 0.06),
    }


def rows_of(rng, count, context=None, channels=None):
    """Readings (count,) of one soil with 2 % noise, float32; NaN in channels that are absent.

    The wheel and its bearing values are those of the context, or of `exported/wheel.onnx`. Each row
    has pull and sinkage with a probability of one half, or the `channels` named, in all rows.
    """
    given = context or REFERENCE
    radius, width = given["wheel_radius"], given["wheel_width"]
    kc, kphi = (0.0, context["bearing_modulus"]) if context else (KC, KPHI)
    soil = Soil(
        cohesion=rng.uniform(0.0, given["cohesion_max"]),
        friction_angle=rng.uniform(0.44, 0.78),
        shear_modulus=rng.uniform(0.005, given["shear_modulus_max"]),
        kc=kc,
        kphi=kphi,
        n=given["n"],
        a0=0.4,
        a1=0.15,
    )
    pressure = np.exp(rng.uniform(np.log(2e3), np.log(1e4))) if context else None
    middle = pressure * radius * width if context else 60.0
    slip = rng.uniform(0.06, 0.58, count)
    load = np.clip(
        middle * np.exp(rng.uniform(-0.6, 0.6, count)), 31.0 if not context else 5.0, None
    )
    force = Model(Wheel(radius=radius, width=width))(soil, Operating(slip=slip, load=load))
    exact = {"torque": force.torque, "sinkage": force.sinkage, "drawbar_pull": force.drawbar_pull}
    rows = {"slip": slip, "load": load}
    for name, values in exact.items():
        std = {"torque": 0.02 * values, "sinkage": 0.0005, "drawbar_pull": 0.5 + 0.02 * values}[
            name
        ]
        rows[name] = values + std * rng.normal(size=count)
        if name in OPTIONAL_READINGS:
            present = rng.random(count) < 0.5 if channels is None else name in channels
            rows[name] = np.where(present, rows[name], np.nan)
    return {name: values.astype(np.float32) for name, values in rows.items()}
