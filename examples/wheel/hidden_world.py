"""A wheel that digs itself in with slip, which the model file of `make demo` lacks.

The readings are those of the simulator of the blind sets, which shares no code with soilml.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from datagen.blind_sets.plans import active_mechanisms
from datagen.blind_sets.reference_wheel import SoilReaction, WheelState, solve_equilibrium
from soilml import Case, Estimator
from soilml.arrays import Floats
from soilml.io.atomic_files import save_text
from soilml.io.text_tables import csv_text
from soilml.quantities import SHEAR

#: The hidden effect, slip-sinkage z = z0 (1 + n1 s), and its n1.
EFFECT, SIZE = "slip-sinkage", 0.4
LOADS, SLIPS = (40.0, 60.0, 80.0, 100.0), np.linspace(0.06, 0.55, 12)
SOIL = {"cohesion": 1200.0, "friction_angle": 0.59, "shear_modulus": 0.014}
SOILS, READINGS = 40, 16  # Soils after the campaign, and readings of each
CHANNELS = {"torque": "torque_Nm", "pull": "drawbar_pull_N", "sinkage": "sinkage_m"}


def drive(case: Case, soil: dict[str, float], slip: Floats, load: Floats) -> SoilReaction:
    """Forces without noise of the wheel of the case on a soil, with the hidden effect; (n,), SI."""
    size = (case.parameters()[f"gear.{name}"][1] for name in ("radius", "width"))
    rows = WheelState.on_soil(asdict(case.soil) | soil, slip, load, *size)
    return solve_equilibrium(rows, ((active_mechanisms("A", EFFECT)[0], SIZE),))


def write_campaign(case: Case, path: Path, seed: int = 1) -> None:
    """Four runs on one soil, each of twelve slips at one load, with the noise of the case."""
    rng = np.random.default_rng(seed)
    load, slip = np.repeat(LOADS, SLIPS.size), np.tile(SLIPS, len(LOADS))
    found = drive(case, SOIL, slip, load)
    columns = {"run": [f"load_{x:.0f}_N" for x in load], "slip": slip, "load_N": load}
    for name, key in CHANNELS.items():
        true = getattr(found, name)
        columns[key] = true + case.noise[key].std(true) * rng.standard_normal(true.size)
    save_text(path, csv_text(columns))


@dataclass(frozen=True)
class LaterSoils:
    """Torque readings of further soils with the same hidden effect, and their true c, phi, K."""

    readings: list[dict[str, Floats]]
    truth: Floats  # (soils, 3), SI

    def estimates(self, estimator: Estimator) -> tuple[Floats, Floats, Floats]:
        """Mean, and ends of the 90 % intervals, of each soil by a model file; (soils, 3)."""
        found = [estimator.run(**one) for one in self.readings]
        mean, low, high = (
            np.stack([getattr(e, k) for e in found]) for k in ("mean", "low", "high")
        )
        return mean, low, high

    def figures(self, estimator: Estimator) -> tuple[Floats, Floats]:
        """Root mean square error and share in the 90 % intervals, of c, phi and K; (3,) each."""
        mean, low, high = self.estimates(estimator)
        inside = (low <= self.truth) & (self.truth <= high)
        return np.sqrt(np.mean((mean - self.truth) ** 2, axis=0)), np.mean(inside, axis=0)


def later_soils(case: Case, seed: int = 2) -> LaterSoils:
    """Soils drawn from the prior, each with a few slips and loads as they come."""
    rng = np.random.default_rng(seed)
    readings, truth = [], []
    while len(readings) < SOILS:
        soil = {k: float(rng.uniform(case.prior[k].lower, case.prior[k].upper)) for k in SHEAR}
        slip = rng.uniform(SLIPS[0], SLIPS[-1], READINGS)
        load = rng.uniform(LOADS[0], LOADS[-1], READINGS)
        torque = drive(case, soil, slip, load).torque
        torque = torque + case.noise["torque_Nm"].std(torque) * rng.standard_normal(READINGS)
        if np.isfinite(torque).all():
            readings.append({"slip": slip, "torque": torque, "load": load})
            truth.append([soil[name] for name in SHEAR])
    return LaterSoils(readings, np.asarray(truth))
