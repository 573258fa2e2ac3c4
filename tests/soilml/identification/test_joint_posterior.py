"""Samples of soil and shared errors together, beside a Markov chain of the same density."""

from dataclasses import replace

import numpy as np
import pytest

from datagen.recipe import read_recipe
from soilml import Operating, Table
from soilml.fitting.shared_errors import usual_errors
from soilml.identification import select_free, usable_readings
from soilml.identification.posterior import posterior
from soilml.identification.posterior_density import PosteriorDensity
from soilml.quantities import SHEAR

WALKERS, STEPS = 160, 2000


def markov_chain(log_density, start, rng):
    """Points (n, p) of the unit cube by differential evolution (ter Braak 2006, eq. 2).

    Every tenth step has the factor 1, which lets points pass from mode to mode. The first third is
    left out.
    """
    half, p = WALKERS // 2, start.shape[1]
    x, logs, kept = start.copy(), log_density(start), []
    for step in range(STEPS):
        size = 1.0 if step % 10 == 0 else 2.38 / np.sqrt(2 * p) * rng.choice([0.5, 1.0])
        for part in np.split(rng.permutation(WALKERS), 2):
            others = np.setdiff1d(np.arange(WALKERS), part)
            pairs = np.argsort(rng.random((half, half)), axis=1)[:, :2]
            difference = x[others[pairs[:, 0]]] - x[others[pairs[:, 1]]]
            new = x[part] + size * difference + 1e-5 * rng.standard_normal((half, p))
            at_new = log_density(new)
            moved = np.log(rng.random(half)) < at_new - logs[part]
            x[part[moved]], logs[part[moved]] = new[moved], at_new[moved]
        if step > STEPS // 3:
            kept.append(x.copy())
    return np.concatenate(kept)


@pytest.mark.long
@pytest.mark.parametrize("channels", [("torque",), ("torque", "sinkage", "drawbar_pull")])
def test_soil_and_usual_errors_are_sampled_as_by_a_markov_chain(channels):
    case, rng = read_recipe("wheel").case, np.random.default_rng(0)
    slip, load = rng.uniform(0.08, 0.6, 16), rng.choice([40.0, 70.0, 100.0], 16)
    stronger = case.with_values({"kc": 1.6 * case.soil.kc, "kphi": 1.6 * case.soil.kphi})
    force = stronger.model(stronger.soil, Operating(slip=slip, load=load))
    columns = {"torque": "torque_Nm", "sinkage": "sinkage_m", "drawbar_pull": "drawbar_pull_N"}
    rows = {"slip": slip, "load_N": load}
    for name in channels:
        y = getattr(force, name)
        rows[columns[name]] = y + case.noise[columns[name]].std(y) * rng.standard_normal(16)
    table = Table(rows)
    data, free = usable_readings(case, table), select_free(case, SHEAR)
    data = replace(data, shared_errors=usual_errors(case, data.load, [f.path for f in free]))
    density, fit = PosteriorDensity(case, data, free), posterior(case, data, free)

    def log_density(u):
        inside = np.all((u > 0.0) & (u < 1.0), axis=1)
        logs = np.full(len(u), -np.inf)
        logs[inside] = density(u[inside])
        return logs

    errors = rng.normal(0.5, 0.1, (WALKERS, len(density.free) - len(SHEAR))).clip(0.1, 0.9)
    start = np.hstack([rng.uniform(0.05, 0.95, (WALKERS, len(SHEAR))), errors])
    chain = markov_chain(log_density, start, rng)
    values = np.stack([f.prior.at(chain[:, i]) for i, f in enumerate(free)], axis=1)
    mean, std = values.mean(axis=0), values.std(axis=0)
    assert np.abs((fit.values - mean) / std).max() < 0.15
    assert np.abs(fit.std / std - 1.0).max() < 0.15
    ends = np.quantile(values, [0.05, 0.95], axis=0)
    assert np.abs((np.stack(fit.interval) - ends) / std).max() < 0.25
