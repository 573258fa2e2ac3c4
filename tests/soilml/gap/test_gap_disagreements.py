"""Correlated residuals, and what forbids an all-clear, evaluated by hand."""

from dataclasses import replace

import numpy as np
import pytest
from gap_sets import case_of, driven, fit_problem

from soilml.gap.evidence.covariance import _is_autocorrelated
from soilml.gap.evidence.directions import smooth_basis
from soilml.gap.verdict import disagreements
from soilml.remarks import texts


@pytest.fixture(scope="module")
def sound():
    """A problem on rows with the declared noise, and the soil fitted to them."""
    case = case_of()
    problem = fit_problem(case, driven(case))
    return problem, problem.fit_soil([np.full(3, 0.5)])


def test_residuals_are_correlated_where_products_of_neighbours_exceed_two_sigma():
    """Beside many fixed effects, which make neighbours of pure noise unlike each other."""
    case = case_of()
    readings = fit_problem(case, driven(case, slips=8)).readings
    run, sample = readings.run[readings.row], readings.order[readings.row]
    neighbours = [
        (i, j)
        for i in range(len(readings))
        for j in range(len(readings))
        if (run[i], readings.channel[i]) == (run[j], readings.channel[j])
        and sample[j] == sample[i] + 1
    ]
    assert len(neighbours) == 4 * 3 * 7
    basis = smooth_basis(readings)
    q = np.linalg.qr(basis / readings.std[:, None])[0]
    hat = q @ q.T
    decided = []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        scale = rng.uniform(0.3, 3.0)
        white = rng.standard_normal(len(readings))
        for i, j in neighbours:
            white[j] += rng.uniform(0.0, 0.5) * white[i]
        left = scale * (white - hat @ white)
        power = np.mean(left**2)
        expected = -sum(hat[i, j] for i, j in neighbours) * power
        excess = sum(left[i] * left[j] for i, j in neighbours) - expected
        sigma = excess / (power * np.sqrt(len(neighbours)))
        found = _is_autocorrelated(readings, scale * white * readings.std, basis)
        assert found == (sigma > 2.0)
        decided.append(found)
    assert 0.2 < np.mean(decided) < 0.9


def test_few_neighbours_are_not_judged():
    case = case_of()
    for slips, judged in ((4, True), (3, False)):
        readings = fit_problem(case, driven(case, loads=(60.0,), slips=slips)).readings
        nothing = np.zeros((len(readings), 0))
        assert _is_autocorrelated(readings, readings.std, nothing) == judged


@pytest.mark.parametrize(
    "component, value, said",
    [
        ("noise_scale", np.asarray([1.0, 1.0, 1.3]), "scatter 1.3 times as much"),
        ("noise_scale", np.asarray([1.29, 1.29, 1.29]), ""),
        ("friction_angle_std", np.deg2rad(1.5001), "friction angle varies by 1.5 deg"),
        ("friction_angle_std", np.deg2rad(1.499), ""),
        ("bearing_std", 0.1501, "bearing strength varies by 15%"),
        ("bearing_std", 0.149, ""),
    ],
)
def test_noise_and_runs_beyond_the_usual_forbid_an_all_clear(sound, component, value, said):
    problem, soil = sound
    known = problem.covariance.components
    changed = replace(problem.covariance, components=replace(known, **{component: value}))
    found = disagreements.disagreements(replace(problem, covariance=changed), soil)
    assert len(found) == bool(said) and said in "".join(texts(found))


def test_a_region_that_the_rest_does_not_predict_is_stated(sound):
    problem, soil = sound
    assert disagreements._region(problem, soil) == []
    readings = problem.readings
    heavy = readings.load >= 139.0
    for sigma, fails in ((3.0, True), (0.3, False)):
        off = np.where(heavy, sigma * readings.std, 0.0) * np.where(readings.channel == 2, -1, 1)
        moved = replace(problem, readings=replace(readings, measured=readings.measured + off))
        found = disagreements._region(moved, soil)
        assert len(found) == fails
        if fails:
            assert found[0].text.startswith(
                "the region load_N >= 140 is not predicted by a fit to the"
            )
            assert 4.0 < float(found[0].text.split()[-4]) < 12.0  # 3 sigma beside noise
    two = fit_problem(case_of(), driven(case_of(), loads=(40.0, 60.0), slips=2))
    assert disagreements._region(two, soil) == []
