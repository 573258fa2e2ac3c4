"""What the tests of the gap workflow share: a wheel, runs driven with it, and sealed sets."""

from __future__ import annotations

import tempfile
from functools import cache
from pathlib import Path

import numpy as np
from conftest import THREE_CHANNEL_MODEL

from datagen.blind_sets import Plan, draw_blind_set
from soilml.config.case import Case, read_case
from soilml.gap import gap
from soilml.io.table import Table
from soilml.physics.effects import EFFECTS
from soilml.physics.operating_point import Operating
from soilml.quantities import CHANNELS, column
from soilml.remarks import Remark

MODEL = THREE_CHANNEL_MODEL.replace("2 %", "1 %")
LOADS = (40.0, 60.0, 90.0, 140.0)


def remark(text):
    """A remark with this text, which is its code too."""
    return Remark(text, text)


def case_of(text: str = MODEL, effects=EFFECTS) -> Case:
    """The case that a model file with this text holds."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.toml"
        path.write_text(text)
        return read_case(path, effects)


def driven(case, effects=(), *, loads=LOADS, slips=8, noise=1.0, soils=None, seed=0, **covariates):
    """A table of one run for each load; `soils` are the soil values of each run, by name."""
    rng = np.random.default_rng(seed)
    model = case.model
    for effect in effects:
        model = model + effect
    runs, load = len(loads), np.repeat(np.asarray(loads, dtype=float), slips)
    slip = np.tile(np.linspace(0.06, 0.6, slips), runs)
    known = {name: np.repeat(np.asarray(v, dtype=float), slips) for name, v in covariates.items()}
    per_run = {name: np.repeat(values, slips) for name, values in (soils or {}).items()}
    soil = case.with_values(per_run).soil if per_run else case.soil
    force = model(soil, Operating(slip=slip, load=load, **known))
    columns = {"run": np.repeat([f"run_{i}" for i in range(runs)], slips)}
    columns |= {"slip": slip, "load_N": load}
    for name in CHANNELS:
        true = np.asarray(getattr(force, name))
        std = case.noise[column(name)].std(true) if column(name) in case.noise else 0.0
        columns[column(name)] = true + noise * std * rng.standard_normal(true.size)
    names = {"speed": "speed_m_s", "pass_number": "pass", "slip_angle": "slip_angle_rad"}
    return Table(columns | {names[name]: values for name, values in known.items()})


#: Sets that tests share; five free parameters make the long search longer.
KINDS = {
    "nothing": Plan("N0", "", 0.0, 0.01, 16, "dry-sand", 3, seed=31305),
    "scatter": Plan("N1", "", 0.0, 0.02, 16, "dry-sand", 3, seed=31379),
    "memory": Plan("N2", "", 0.0, 0.03, 16, "dry-sand", 3, seed=31449),
    "outliers": Plan("N3", "", 0.0, 0.03, 16, "loam", 3, seed=31503),
    "slip-sinkage": Plan("A", "slip-sinkage", 2.0, 0.01, 4, "loam", 5, seed=30007),
    "bulldozing": Plan("A", "bulldozing", 2.0, 0.01, 16, "dry-sand", 3, seed=30072),
    "exit-angle": Plan("A", "exit-angle", 2.0, 0.01, 16, "loam", 3, seed=30110),
    "stick-slip": Plan("C", "stick-slip", 2.0, 0.01, 8, "lunar", 3, seed=30875),
}


@cache
def hidden(kind: str):
    """The case, the table, the region held out and the truth of a sealed set."""
    drawn = draw_blind_set(KINDS[kind])
    columns, region = Table(dict(drawn.columns)), Table(dict(drawn.region))
    return case_of(drawn.model), columns, region, drawn.truth


@cache
def analysed(kind: str):
    """The report on a sealed set."""
    case, table, _, _ = hidden(kind)
    return gap(case, table)
