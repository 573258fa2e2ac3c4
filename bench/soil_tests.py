"""Plate and shear tests beside the runs of a wheel: `python bench/run.py soil-tests`.

`python bench/soil_tests.py` prints the table alone.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from datagen.blind_sets.reference_wheel import WheelState, solve_equilibrium
from soilml import Case, Model, Table, Wheel, identify, soil
from soilml.config.measurement_noise import Noise
from soilml.identification.bevameter import bevameter
from soilml.identification.bevameter.soil_section import updated_soil
from soilml.numerics.prior import Prior
from soilml.physics.soils import Soil

#: Soils, and the seed of all draws.
SOILS, SEED = 120, 41
#: Scatter from place to place, as standard deviations: of the logarithms of pressure, strength and
#: K, and of n.
PRESSURE, STRENGTH, MODULUS, EXPONENT = 0.15, 0.08, 0.2, 0.05
#: Depth at which the scatter of n leaves the pressure as it is.
PIVOT = 0.02
WIDTH = 0.12
KEYS = ("cohesion", "friction_angle", "shear_modulus", "k", "n")
UNKNOWN = Case(
    Model(Wheel(radius=0.15, width=WIDTH)),
    soil("wong1989/dry_sand"),
    {
        "cohesion": Prior(0.0, 3000.0),
        "friction_angle": Prior(0.3, 0.8),
        "shear_modulus": Prior(0.005, 0.05),
        "kphi": Prior(1e5, 1e7, log=True),
        "n": Prior(0.6, 1.6),
    },
    {"torque_Nm": Noise(share=0.02)},
)
ABOUT = (
    "`identify --method posterior` from 24 rows of torque at three loads (2 % noise), on "
    f"{SOILS} soils with five unknown parameters. The wheel is the reference wheel of blind sets, "
    "which shares no code with `soilml`; the soil has four plate tests (two sizes, each twice) and "
    "four shear tests. Every test, and the wheel, is on another place of the soil: pressure "
    "scatters by 15 %, strength by 8 %, K by 20 %, n by 0.05. *Priors of the tests*: the ranges "
    "that `soilml bevameter` writes, each parameter by itself. *And tests*: with `[[soil.test]]` "
    "beside them. k is kc / b + kphi at the width of the wheel; its error is that of the "
    "logarithm. Coverage of 90 % intervals in per cent, and root mean square of the errors."
)


def text(folder: Path | None = None) -> str:
    """The table: coverage and errors by what is known of the soil."""
    rng = np.random.default_rng(SEED)
    found: dict[str, list[list[tuple[bool, float]]]] = {}
    for _ in range(SOILS):
        mean = _drawn(rng)
        wheel, rows = _driven(mean, rng)
        result = bevameter(_plates(mean, rng), _shear(mean, rng), UNKNOWN)
        with_tests = updated_soil(UNKNOWN, result)
        cases = {
            "wheel alone": UNKNOWN,
            "priors of the tests": replace(with_tests, soil_tests=()),
            "and tests": with_tests,
        }
        for name, case in cases.items():
            found.setdefault(name, []).append(_scores(case, rows, wheel))
    lines = [
        "| known of the soil | c: held | error (Pa) | phi: held | error (deg) | K: held | "
        "error (mm) | k: held | error (ln) | n: held | error |",
        f"|---|{'---:|' * 10}",
    ]
    scale = (1.0, np.degrees(1.0), 1e3, 1.0, 1.0)
    for name, sets in found.items():
        held = np.mean([[h for h, _ in one] for one in sets], axis=0)
        error = np.sqrt(np.mean([[e**2 for _, e in one] for one in sets], axis=0)) * scale
        cells = [f"{100 * h:.0f} | {e:.3g}" for h, e in zip(held, error, strict=True)]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _scores(case: Case, rows: Table, truth: Soil) -> list[tuple[bool, float]]:
    """Whether each interval holds the truth, and the error of each value."""
    fit = identify(case, rows, method="posterior")
    low, high = (dict(zip(fit.names, ends, strict=True)) for ends in fit.interval)
    value = dict(zip(fit.names, fit.values, strict=True))
    shared = float(case.soil.kc) / WIDTH
    scores = []
    for key in KEYS:
        if key == "k":
            true = float(truth.kc) / WIDTH + float(truth.kphi)
            ends = shared + low["kphi"], shared + high["kphi"]
            error = float(np.log((shared + value["kphi"]) / true))
        else:
            true, ends = float(getattr(truth, key)), (low[key], high[key])
            error = float(value[key] - true)
        scores.append((bool(ends[0] <= true <= ends[1]), error))
    return scores


def _drawn(rng: np.random.Generator) -> Soil:
    """A soil, its mean over many places."""
    return replace(
        UNKNOWN.soil,
        cohesion=rng.uniform(200.0, 2500.0),
        friction_angle=rng.uniform(0.4, 0.7),
        shear_modulus=rng.uniform(0.01, 0.04),
        kc=1000.0,
        kphi=float(np.exp(rng.uniform(np.log(5e5), np.log(4e6)))),
        n=rng.uniform(0.8, 1.3),
    )


def _place(mean: Soil, rng: np.random.Generator) -> Soil:
    """The soil at one place."""
    z = rng.standard_normal(4)
    n = float(mean.n) + EXPONENT * z[0]
    pressure = np.exp(PRESSURE * z[1]) * PIVOT ** (float(mean.n) - n)
    strength = np.exp(STRENGTH * z[2])
    return replace(
        mean,
        cohesion=float(mean.cohesion) * strength,
        friction_angle=float(np.arctan(np.tan(mean.friction_angle) * strength)),
        shear_modulus=float(mean.shear_modulus) * np.exp(MODULUS * z[3]),
        kc=float(mean.kc) * pressure,
        kphi=float(mean.kphi) * pressure,
        n=n,
    )


def _driven(mean: Soil, rng: np.random.Generator) -> tuple[Soil, Table]:
    """The soil under the wheel, and the wheel's rows."""
    own, gear = _place(mean, rng), UNKNOWN.model.gear
    slip, load = np.tile(np.linspace(0.05, 0.6, 8), 3), np.repeat([40.0, 70.0, 120.0], 8)
    fixed: dict[str, Any] = {
        name: getattr(own, name)
        for name in ("cohesion", "friction_angle", "shear_modulus", "kc", "kphi", "n", "a0", "a1")
    }
    fixed |= {"radius": gear.radius, "width": gear.width, "unit_weight": own.unit_weight}
    fixed |= {"speed": 0.05, "pass_number": 1.0, "slip_angle": 0.0}
    arrays = {name: np.full(slip.shape, float(value)) for name, value in fixed.items()}
    torque = solve_equilibrium(WheelState(slip=slip, load=load, **arrays)).torque
    torque = torque * (1.0 + 0.02 * rng.standard_normal(slip.shape))
    return own, Table({"slip": slip, "load_N": load, "torque_Nm": torque})


def _plates(mean: Soil, rng: np.random.Generator) -> Table:
    """Two sizes of plates, each pressed in at two places."""
    sinkage, parts = np.linspace(0.005, 0.04, 10), []
    for i, radius in enumerate((0.05, 0.05, 0.1, 0.1)):
        own = _place(mean, rng)
        pressure = (float(own.kc) / radius + float(own.kphi)) * sinkage ** float(own.n)
        parts.append((np.full(10, f"plate_{i}"), np.full(10, radius), sinkage, pressure))
    columns = [np.concatenate(column) for column in zip(*parts, strict=True)]
    names = ("test", "plate_radius_m", "sinkage_m", "pressure_Pa")
    return Table(dict(zip(names, columns, strict=True)))


def _shear(mean: Soil, rng: np.random.Generator) -> Table:
    """Four normal stresses, each at a place of its own."""
    moved, parts = np.linspace(0.002, 0.1, 12), []
    for sigma in (3e3, 6e3, 9e3, 12e3):
        own = _place(mean, rng)
        strength = float(own.cohesion) + sigma * np.tan(float(own.friction_angle))
        stress = strength * (1.0 - np.exp(-moved / float(own.shear_modulus)))
        parts.append((np.full(12, f"{sigma:g}"), np.full(12, sigma), moved, stress))
    columns = [np.concatenate(column) for column in zip(*parts, strict=True)]
    names = ("test", "normal_stress_Pa", "shear_displacement_m", "shear_stress_Pa")
    return Table(dict(zip(names, columns, strict=True)))


if __name__ == "__main__":
    print(text())
