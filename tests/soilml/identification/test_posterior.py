"""The posterior: equal to brute force, calibrated, and never worse than least squares."""

from dataclasses import replace

import numpy as np
import pytest
from gap_sets import MODEL, case_of, driven
from measured_rows import torque_rows
from remarked import remarked

from soilml import Operating, identify
from soilml.config.measurement_noise import Noise
from soilml.errors import FitError
from soilml.fitting.coordinates import select_free
from soilml.fitting.misfit import fit_under_declared_noise
from soilml.fitting.readings import stack_readings
from soilml.identification.posterior import posterior_density, sample_posterior
from soilml.io.table import Table
from soilml.numerics.importance_sampling import importance_sample
from soilml.remarks import texts

SLIPS = np.tile(np.linspace(0.1, 0.6, 4), 2)
LOADS = np.repeat([40.0, 100.0], 4)


TRUTH = {"cohesion": 900.0, "friction_angle": 0.6, "shear_modulus": 0.012}


def drawn(case, rng):
    return {name: float(prior.at(rng.random())) for name, prior in case.prior.items()}


def test_sampling_finds_the_moments_and_the_evidence_of_a_bent_ridge():
    def ridge(u):
        x, y, z = u.T
        bend = ((y - 0.2 - 0.6 * x**2) / 0.01) ** 2
        return -0.5 * bend - 0.5 * ((z - 0.5 * x - 0.2) / 0.02) ** 2

    found = importance_sample(ridge, 3, seed=4)
    assert found.effective_size > 2000
    assert found.evidence == pytest.approx(np.log(2 * np.pi * 0.01 * 0.02), abs=0.05)
    mean = found.mean(found.u)
    np.testing.assert_allclose(mean, [0.5, 0.4, 0.45], atol=0.03)  # 5 of its standard errors
    np.testing.assert_allclose(np.sqrt(found.mean((found.u[:, 0] - 0.5) ** 2)), 12**-0.5, rtol=0.04)
    ends = found.quantiles(found.u, np.asarray([0.05, 0.95]))
    np.testing.assert_allclose(ends[:, 0], [0.05, 0.95], atol=0.03)


@pytest.mark.slow
def test_the_posterior_is_that_of_brute_force_on_a_grid(case):
    case = case.with_values(TRUTH)
    table = torque_rows(case, TRUTH, SLIPS, LOADS, noise=0.02, seed=3)
    fit = identify(case, table, ["cohesion", "friction_angle"], "posterior")
    ends = [case.prior[name] for name in fit.names]
    axis = (np.arange(160) + 0.5) / 160
    c, phi = (x.ravel() for x in np.meshgrid(*[p.at(axis) for p in ends], indexing="ij"))
    swept = case.with_values({"cohesion": c[:, None], "friction_angle": phi[:, None]})
    expected = swept.model(swept.soil, Operating(slip=SLIPS, load=LOADS)).torque
    std = case.noise["torque_Nm"].std(expected)
    logs = -0.5 * (((table["torque_Nm"] - expected) / std) ** 2 + 2.0 * np.log(std)).sum(axis=1)
    weight = np.exp(logs - logs.max())
    weight /= weight.sum()
    values = np.stack([c, phi], axis=1)
    mean = weight @ values
    covariance = ((values - mean).T * weight) @ (values - mean)
    assert (np.abs(fit.values - mean) < 0.1 * fit.std).all()
    np.testing.assert_allclose(fit.std, np.sqrt(np.diag(covariance)), rtol=0.05)
    assert fit.correlation[0, 1] == pytest.approx(
        covariance[0, 1] / np.sqrt(np.prod(np.diag(covariance))), abs=0.03
    )


@pytest.mark.long
def test_truths_stand_anywhere_in_their_posteriors_alike_and_no_fit_is_nearer(case):
    rng = np.random.default_rng(5)
    inside, error, other = [], [], []
    for k in range(60):
        truth = drawn(case, rng)
        table = torque_rows(case, truth, SLIPS[:4], LOADS[:4], noise=0.02, seed=k)
        values = np.asarray([truth[name] for name in case.prior])
        fit = identify(case, table, None, "posterior")
        inside.append((fit.interval[0] <= values) & (values <= fit.interval[1]))
        error.append((fit.values - values) ** 2)
        other.append((identify(case, table, method="nonlinear").values - values) ** 2)
    assert (np.abs(np.mean(inside, axis=0) - 0.9) < 0.12).all()  # 60 draws: 3 sigma
    assert (np.mean(error, axis=0) < np.mean(other, axis=0)).all()


def test_what_rows_do_not_tell_comes_out_as_the_prior_and_is_said(case):
    table = torque_rows(case, TRUTH, np.asarray([0.2]), np.asarray([60.0]), noise=0.02, seed=1)
    fit = identify(case, table, None, "posterior")
    assert fit.remaining_fraction["cohesion"] > 0.8
    assert remarked(fit.warnings, "cohesion is not identified")
    low, high = fit.interval
    prior = [case.prior[name] for name in fit.names]
    assert all(p.lower <= a < b <= p.upper for p, a, b in zip(prior, low, high, strict=True))


@pytest.mark.slow
def test_a_model_that_lacks_something_is_said_to(case):
    table = torque_rows(case, TRUTH, SLIPS, LOADS, noise=0.02, seed=1)
    measured_well, shaken = (
        table,
        table["torque_Nm"] * np.tile([0.9, 1.1], 4),
    )  # five times the declared 2 %
    table = Table(dict(table.columns) | {"torque_Nm": shaken})
    fit, calm = (identify(case, t, None, "posterior") for t in (table, measured_well))
    assert "times the declared noise" in " ".join(texts(fit.warnings))
    assert (fit.std > 2.0 * calm.std).all()


def test_noise_that_nobody_declared_is_asked_for(case):
    table = torque_rows(case, TRUTH, SLIPS, LOADS, noise=0.02, seed=1)
    with pytest.raises(FitError, match="declare it in"):
        identify(type(case)(case.model, case.soil, case.prior), table, None, "posterior")


@pytest.mark.slow
def test_many_rows_leave_a_normal_posterior_about_the_least_squares(case):
    rng = np.random.default_rng(2)
    slip, load = rng.uniform(0.05, 0.6, 700), rng.choice([40.0, 70.0, 100.0], 700)
    table = torque_rows(case, TRUTH, slip, load, noise=0.02, seed=6)
    fit = identify(case, table, None, "posterior")
    least_squares = identify(case, table, None, "nonlinear")
    # so many rows determine the parameters that the posterior is normal about the least squares
    assert np.all(np.abs(fit.values - least_squares.values) < 0.15 * least_squares.std)
    np.testing.assert_allclose(fit.std, least_squares.std, rtol=0.08)


@pytest.mark.slow
def test_noise_of_slip_is_linearised_where_the_posterior_is(case):
    case = replace(case, noise=case.noise | {"slip": Noise(constant=0.02)})
    table = torque_rows(case, TRUTH, SLIPS, LOADS, noise=0.02, seed=7)
    fit = identify(case, table, None, "posterior")
    exact = identify(
        replace(case, noise={"torque_Nm": Noise(share=0.02)}), table, None, "posterior"
    )
    assert np.all(fit.std > 1.1 * exact.std)


@pytest.mark.slow
def test_dead_corners_of_the_prior_are_passed_over_in_silence(recwarn):
    def cornered(u):
        near = -0.5 * (((u - 0.7) / 1e-4) ** 2).sum(axis=1)
        return np.where(u[:, 0] < 0.4, -np.inf, near)

    assert importance_sample(cornered, 3).effective_size > 1000
    assert not recwarn.list


@pytest.mark.slow
def test_a_narrow_and_bent_posterior_keeps_its_tails():
    """Bearing and exponent follow a bent valley."""
    text = MODEL.replace("[noise]", "kphi = [2e5, 5e6]\nn = [0.5, 1.6]\n[noise]")
    case = case_of(text)
    free = select_free(case, None)
    readings = stack_readings(case, driven(case, loads=(60.0, 120.0), slips=10))
    optimum = fit_under_declared_noise(case, readings, free)
    found = sample_posterior(optimum)
    whole = importance_sample(posterior_density(optimum.problem, optimum.x), len(free), seed=1)
    ends = np.asarray([0.02, 0.5, 0.98])
    std = np.sqrt(whole.mean((whole.u - whole.mean(whole.u)) ** 2))
    off = (found.quantiles(found.u, ends) - whole.quantiles(whole.u, ends)) / std
    assert np.abs(off).max() < 0.3
