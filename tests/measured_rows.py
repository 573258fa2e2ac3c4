"""Measured rows of a case, of one with three channels and of one with two gears."""

from dataclasses import replace

import numpy as np

from soilml import Operating, simulate
from soilml.io.table import Table

CHANNELS = {"torque_Nm": "torque", "drawbar_pull_N": "drawbar_pull", "sinkage_m": "sinkage"}


def measured(case, rng, rows, channels=CHANNELS, gear=None, least_slip=-0.05):
    """Readings with the noise of the case, of a soil drawn from its priors."""
    true = case.with_values({n: float(p.at(rng.random())) for n, p in case.prior.items()})
    slip, load = rng.uniform(least_slip, 0.6, rows), rng.choice([35.0, 60.0, 85.0, 110.0], rows)
    columns = {"slip": slip, "load_N": load}
    models = {None: true.model, **true.gears}
    for key in channels:
        value = np.empty(rows)
        for name in np.unique(gear) if gear is not None else [None]:
            own = slice(None) if gear is None else gear == name
            at = Operating(slip=slip[own], load=load[own])
            value[own] = getattr(models[name](true.soil, at), CHANNELS[key])
        columns[key] = value + case.noise[key].std(value) * rng.standard_normal(rows)
    return Table(columns if gear is None else {"gear": gear, **columns})


def torque_rows(case, truth, slip, load, noise=0.0, seed=0, more=()):
    """One run on the soil of `truth`: its torque with a share of noise, and more channels."""
    rows = simulate(case.with_values(truth), slip, load, run="a")
    found = Table({name: rows[name] for name in ("run", "slip", "load_N", "torque_Nm", *more)})
    factor = 1.0 + noise * np.random.default_rng(seed).standard_normal(len(found))
    found.columns["torque_Nm"] = found["torque_Nm"] * factor
    return found


def two_gears(case):
    wheel = case.model.gear
    wide = replace(case.model, gear=replace(wheel, width=0.2))
    return replace(case, gears={"narrow": case.model, "wide": wide})
