"""Reference sets, their exact posteriors, and the answers of files to them."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from datagen.recipe import read_recipe
from soilml.config.measurement_noise import Noise
from soilml.physics.operating_point import Operating
from soilml.quantities import SHEAR
from training.set_posterior.families.dimensionless_family import DimensionlessFamily
from training.set_posterior.families.recipe_family import RecipeFamily
from training.set_posterior.graph import SetPosteriorGraph
from training.set_posterior.posterior_summary import MisfitLimits
from training.set_posterior.validation import graph_outputs, posterior_session
from training.spec import read_any_wheel_spec

sys.path.insert(0, str(Path(__file__).parents[1] / "bench"))

from exact_sets import exact_set_posterior
from reference_sets import ONE_WHEEL, generate_reference_sets, stored_posteriors

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def some():
    return generate_reference_sets(2)


def test_the_stored_posterior_of_a_set_is_reproduced(some):
    limit = stored_posteriors(some)
    for i in (0, 3, len(some) // 2):
        again = exact_set_posterior(some[i].family, some[i].sets, 0)
        std = np.sqrt(np.diag(again.covariance))
        assert np.all(np.abs(again.mean - limit["mean"][i]) < 0.1 * std)


STEPS = 36


def of_one_wheel(noise, bias=0.0) -> RecipeFamily:
    recipe = read_recipe("wheel")
    case = replace(recipe.case, noise=recipe.case.noise | {"torque_Nm": Noise(share=noise)})
    shared = {"torque_Nm": Noise(share=bias)} if bias else {}
    return RecipeFamily.of(replace(recipe, case=case, bias=shared), SHEAR)


def on_a_grid(family, sets, index):
    """Weights, values and log evidence on a grid of equal prior probability."""
    case, rows = family.recipe.case, sets.rows(index)
    u = (np.arange(STEPS) + 0.5) / STEPS
    grid = np.stack(np.meshgrid(u, u, u, indexing="ij"), axis=-1).reshape(-1, 3)
    values = np.stack([case.prior[n].at(grid[:, i]) for i, n in enumerate(SHEAR)], axis=1)
    soil = case.with_values({n: values[None, :, i] for i, n in enumerate(SHEAR)}).soil
    operating = Operating(slip=rows["slip"][:, None], load=rows["load"][:, None])
    torque = case.model(soil, operating).torque.T
    noise, bias = case.noise["torque_Nm"].share, family.recipe.bias.get("torque_Nm", Noise()).share
    m = torque.shape[1]
    shape = noise**2 * np.eye(m) + bias**2
    # readings over true torques have the same distribution for all soils
    off = multivariate_normal(np.ones(m), shape).logpdf(rows["torque"] / torque)
    logs = off - np.log(torque).sum(axis=1)
    logs += 0.5 * m * np.log(2.0 * np.pi)  # left out of the likelihood
    weights = np.exp(logs - logs.max())
    return weights / weights.sum(), values, np.log(np.mean(np.exp(logs - logs.max()))) + logs.max()


def torque_only(family, rows):
    """A set in which only torque was read."""
    sets = family.sets(20, rows, 9)
    return sets, int(np.flatnonzero(sets.readings["sinkage_std"][:, 0] > 1.0)[0])


@pytest.mark.parametrize(("rows", "noise", "bias"), [(1, 0.06, 0.0), (2, 0.08, 0.04)])
def test_it_agrees_with_integration_on_a_grid(rows, noise, bias):
    family = of_one_wheel(noise, bias)
    sets, index = torque_only(family, rows)
    found = exact_set_posterior(family, sets, index)
    weights, values, evidence = on_a_grid(family, sets, index)
    mean = weights @ values
    off = values - mean
    covariance = (off.T * weights) @ off
    std = np.sqrt(np.diag(covariance))
    assert not found.flagged
    assert np.all(np.abs(found.mean - mean) < 0.08 * std)
    apart = (found.covariance - covariance) / np.outer(std, std)
    assert np.all(np.abs(apart) < 0.08)
    assert found.log_evidence == pytest.approx(evidence, abs=0.06)


def test_uncertain_bearing_is_marginalised():
    family = read_any_wheel_spec("any_wheel").family
    assert isinstance(family, DimensionlessFamily)
    sets = family.sets(300, 1, 9)
    o = sets
    more = sets.readings["sinkage_std"][:, 0] < 1.0
    uncertain = (o.noise["torque"][1][:, 0] > 0.06) & (o.normal_std > 0.2) & ~more
    index = int(np.flatnonzero(uncertain)[0])
    found = exact_set_posterior(family, sets, index)
    rng = np.random.default_rng(2)
    n = 30_000
    x = np.stack([a.quantile(rng.random(n)) for a in family.axes[:3]], axis=1)
    near = np.clip(rng.standard_normal((n, 2)), -2.5, 2.5) * o.normal_std[index]
    force = family.force(o.designs[index], np.concatenate([x, near], axis=1)[None])
    noise, bias = o.noise["torque"][1][index, 0], o.noise["torque_bias"][1][index, 0]
    off = sets.readings["torque"][index, 0] / force.torque[0] - 1.0
    weights = np.exp(-0.5 * off**2 / (noise**2 + bias**2)) / force.torque[0]
    weights = np.nan_to_num(weights / np.nansum(weights))
    scale = [o.designs[index, 0, 6], 1.0, o.designs[index, 0, 7]]
    values = np.stack([a.value(x[:, i]) for i, a in enumerate(family.axes[:3])], axis=1) * scale
    mean = weights @ values
    std = np.sqrt(weights @ (values - mean) ** 2)
    assert np.all(np.abs(found.mean - mean) < 0.08 * std)
    assert np.all(np.abs(np.sqrt(np.diag(found.covariance)) / std - 1.0) < 0.06)


@pytest.fixture(scope="module")
def pairs(wheel_posterior):
    """(output of the graph, exact posterior) of sets; small response."""
    family, response = wheel_posterior.family, wheel_posterior.response
    free = MisfitLimits(np.asarray([1.0, 2.0]), np.asarray([1e9, 2e9]))
    session = posterior_session(SetPosteriorGraph(family, response, free))
    found = []
    for rows in (1, 6):
        sets = family.sets(14, rows, 21)
        for i in range(len(sets.truth)):
            output = graph_outputs(session, response, sets, i)
            found.append((output, exact_set_posterior(family, sets, i)))
    return found


def test_the_estimate_is_close_to_the_exact_posterior(pairs):
    off = [(s["set_mean"] - e.mean) / np.sqrt(np.diag(e.covariance)) for s, e in pairs]
    assert np.sqrt(np.mean(np.square(off))) < 0.3
    wide = [s["set_std"] / np.sqrt(np.diag(e.covariance)) for s, e in pairs]
    assert 0.85 < np.median(wide) < 1.15


def test_sets_are_scored_beside_their_exact_posterior():
    import sets
    from runner import rows_of

    case = {"name": f"wheel, {ONE_WHEEL}", "rows": 6, "count": 3}
    rows = rows_of([{"case": case, "rows": sets.measured(case)}])
    assert len(rows) == 3 and all(row["answered"] for row in rows)
    ratio, _ = sets.rmse_ratio(rows)
    assert np.all((ratio > 0.7) & (ratio < 1.4))
    exact = [row | {"error": [row["error"][1]] * 2} for row in rows]
    assert sets.rmse_ratio(exact)[0] == pytest.approx(1.0)
    text = sets.tables([row | {"held90": np.ones((2, 3), bool)} for row in exact])
    assert "| 1.000 |" in text and "100.0% / 100.0%" in text
