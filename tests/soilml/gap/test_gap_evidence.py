"""Evidence beside a smooth discrepancy: against dense algebra, and on data with one."""

from dataclasses import replace

import numpy as np
import pytest
from gap_sets import case_of, driven, fit_problem

from soilml.config.measurement_noise import Discrepancy
from soilml.fitting.covariance import discrepancy_process
from soilml.gap.evidence.linearised_fit import AMPLITUDES, LinearisedFit, amplitude_penalty
from soilml.gap.evidence.marginal_likelihood import LARGEST_SIZE, _size_prior, outside_bounds
from soilml.gap.evidence.problem import StartedFit, fit_many
from soilml.numerics.prior import UNIFORM_PRECISION
from soilml.physics.effects import EFFECTS


@pytest.fixture(scope="module")
def problem():
    case = case_of()
    return fit_problem(case, driven(case, [EFFECTS["slip-sinkage"](n1=0.4)], seed=2), (0.8, 0.8))


@pytest.fixture(scope="module")
def soil(problem):
    return problem.fit_soil([np.full(3, 0.5)])


def test_the_process_has_the_stated_covariance(problem):
    readings = problem.readings
    process = discrepancy_process(readings, {"torque_Nm": Discrepancy(constant=0.3)})
    own = readings.channel == readings.channels.index("torque")
    s, w = readings.slip[own] / 0.3, np.log(readings.load[own]) / 0.6
    kernel = np.exp(-0.5 * ((s[:, None] - s) ** 2 + (w[:, None] - w) ** 2))
    columns = process.columns[own]
    assert columns @ columns.T == pytest.approx(0.09 * kernel, abs=0.002 * 0.09)
    other = process.columns[~own][:, process.channel == readings.channels.index("torque")]
    assert np.all(other == 0.0)
    span = readings.measured[own].max()  # positive, so that the range from zero is the largest
    assert discrepancy_process(readings, {}).usual[0] == pytest.approx(0.02 * span)


@pytest.mark.parametrize("amplitude", [(0.0, 0.0, 0.0), (1.0, 0.0, 4.0), (25.0, 10.0, 0.4)])
def test_whitening_leaves_unit_covariance(problem, amplitude):
    model, amplitude = problem.discrepancy, np.asarray(amplitude)
    whiten, matrix = model.whiten(amplitude), model.matrix(amplitude)
    dense = whiten @ np.eye(len(matrix))
    assert dense @ matrix @ dense.T == pytest.approx(np.eye(len(matrix)), abs=1e-6)
    values = np.random.default_rng(1).normal(size=(len(matrix), 2))
    assert whiten @ values == pytest.approx(dense @ values, rel=1e-9)
    assert whiten @ values[:, 0] == pytest.approx(dense @ values[:, 0], rel=1e-9)
    assert whiten.noise is model.noise_whitening  # shared: many fits hold one matrix
    assert whiten.basis.shape[1] <= model.process.columns.shape[1]


@pytest.mark.parametrize("amplitude", [(0.0, 0.0, 0.0), (1.0, 0.0, 4.0)])
@pytest.mark.parametrize("by_run", [True, False])
def test_whitening_of_a_part_leaves_unit_covariance(problem, amplitude, by_run):
    amplitude, readings = np.asarray(amplitude), problem.readings
    run = readings.run[readings.row]
    selected = run > 0 if by_run else np.arange(len(readings)) % 3 > 0
    part = problem.discrepancy.of_readings(selected, run)
    dense = part.whiten(amplitude) @ np.eye(int(selected.sum()))
    matrix = problem.discrepancy.matrix(amplitude)[np.ix_(selected, selected)]
    assert dense @ matrix @ dense.T == pytest.approx(np.eye(len(matrix)), abs=1e-6)


def test_the_evidence_is_that_of_dense_algebra(problem, soil):
    found = problem.discrepancy.evidence(soil)
    base = problem.covariance.matrix

    def dense(amplitude):
        matrix = problem.discrepancy.matrix(amplitude)
        inverse = np.linalg.inv(matrix)
        residual = soil.measured - soil.prediction
        h = soil.derivatives.T @ inverse @ soil.derivatives + UNIFORM_PRECISION * np.eye(3)
        inside = (soil.x > 0.0) & (soil.x < 1.0)  # coordinates at a bound stay there
        slope = soil.derivatives.T @ inverse @ residual
        gradient = slope[inside]
        step = np.linalg.solve(h[np.ix_(inside, inside)], gradient)
        value = residual @ inverse @ residual - gradient @ step
        value += outside_bounds(soil, slope, h)
        value += np.linalg.slogdet(matrix)[1] - np.linalg.slogdet(base)[1]
        return value + np.linalg.slogdet(h)[1] + amplitude_penalty(amplitude[None, :])[0]

    assert found.value == pytest.approx(dense(found.amplitude), rel=1e-6)
    for i in range(3):  # no amplitude of one channel is better
        for other in AMPLITUDES:
            trial = found.amplitude.copy()
            trial[i] = other
            assert dense(trial) >= found.value - 0.11


def test_prior_probabilities_of_the_amplitudes_sum_to_one():
    single = amplitude_penalty(AMPLITUDES[:, None])
    assert np.exp(-0.5 * single).sum() == pytest.approx(1.0)


def test_the_true_effect_has_more_evidence_than_any_discrepancy(problem, soil):
    request = StartedFit(
        problem.with_effects(["slip-sinkage"]),
        [*problem.soil, *problem.size_coordinates(["slip-sinkage"])],
        soil.start_values(),
    )
    dug = problem.discrepancy.evidence(fit_many(problem, [request])[0])
    none = problem.discrepancy.evidence(soil)
    assert none.value - dug.value > 30.0
    assert np.max(dug.amplitude) < 0.5 < np.max(none.amplitude)


def test_the_prior_of_a_size_is_a_density():
    x = np.linspace(0.0, LARGEST_SIZE, 200_001)
    value = np.asarray([_size_prior(float(v), two_sided=False)[2] for v in x[:-1:20]])
    density = np.exp(-0.5 * (value + np.log(2.0 * np.pi)))
    assert np.sum(density) * (x[20] - x[0]) == pytest.approx(1.0, abs=0.01)
    assert _size_prior(0.3, two_sided=True)[2] > _size_prior(0.3, two_sided=False)[2]


def test_an_effect_that_changes_nothing_gains_nothing(problem, soil):
    plain = problem.discrepancy.evidence(soil)
    none = np.zeros((len(problem.readings), 1))
    (nothing,) = problem.discrepancy.evidence_with_each(soil, none)
    assert nothing.value == pytest.approx(plain.value, abs=2.5)  # Laplace at the prior's cusp
    assert nothing.step[-1] == 0.0


def test_the_evidence_of_several_effects_is_that_of_each_alone(problem, soil):
    model, start = problem.discrepancy, np.asarray([1.0, 0.0, 0.4])
    columns = np.stack([s.column for s in problem.signatures_beside(soil)], axis=1)
    found = model.evidence_with_each(soil, columns, start)
    assert len({tuple(own.amplitude) for own in found}) > 1  # they are searched apart
    for own, column in zip(found, columns.T, strict=True):
        (alone,) = model.evidence_with_each(soil, column[:, None], start)
        assert own.value == pytest.approx(alone.value, rel=1e-9)
        np.testing.assert_array_equal(own.amplitude, alone.amplitude)
        np.testing.assert_allclose(own.step, alone.step, rtol=1e-7, atol=1e-10)


def test_a_smooth_discrepancy_is_recognised_by_its_size(problem):
    case = problem.case
    table = driven(case, seed=4)
    slip, torque = table["slip"], table["torque_Nm"]
    wave = 0.05 * torque.max() * np.sin(9.0 * slip + 0.02 * table["load_N"])
    wavy = replace(table, columns=table.columns | {"torque_Nm": torque + wave})
    other = fit_problem(case, wavy)
    found = other.discrepancy.evidence(other.fit_soil([np.full(3, 0.5)]))
    assert 1.0 <= found.amplitude[0] <= 6.3  # its rms is 1.8 usual amplitudes
    assert found.amplitude[0] > 2.0 * found.amplitude[1]


def test_the_prior_of_a_size_falls_beyond_usual_sizes():
    sizes = np.geomspace(1e-6, 1e4, 20001)
    value = np.asarray([_size_prior(float(x), two_sided=False)[2] for x in sizes])
    density = np.exp(-0.5 * value) / np.sqrt(2.0 * np.pi)
    assert np.trapezoid(density, sizes) == pytest.approx(1.0, abs=0.1)
    assert np.trapezoid(density[sizes > 50.0], sizes[sizes > 50.0]) < 0.01
    curvature, slope, at = _size_prior(20.0, two_sided=False)
    ahead = _size_prior(20.001, two_sided=False)[2]
    assert (ahead - at) / 0.001 == pytest.approx(2.0 * slope, rel=1e-3)
    assert curvature > 0.0


@pytest.mark.parametrize("held", [[], [1], [0, 4]])
def test_the_evidence_is_that_of_the_step_of_all_coordinates_that_are_not_at_a_bound(
    monkeypatch, held
):
    rng = np.random.default_rng(4)
    movable = ~np.isin(np.arange(6), held)
    gradient = np.asarray([0.0, 0.0, 0.3, -2.0, 0.0, 0.0])
    fit = LinearisedFit(None, None, None, np.diag([3.0, 3, 1, 4, 2, 1]), gradient, movable, 1.5)
    jacobian = rng.normal(size=(2, 30, 7))
    product = jacobian.swapaxes(1, 2) @ jacobian
    columns = np.asarray([[0, 1, 2, 3, 6], [0, 1, 2, 4, 6]])
    with monkeypatch.context() as only_the_factor:
        only_the_factor.setattr(LinearisedFit, "_solve", None)
        found = fit._evidence(product, columns)
    for model, own in enumerate(columns[:, :-1]):
        free = own[movable[own]]
        for i, all_columns in enumerate(product):
            h, g = all_columns + np.pad(fit.precision, (0, 1)), all_columns[:6, 6] - gradient
            step = np.linalg.solve(h[np.ix_(free, free)], g[free])
            left = all_columns[6, 6] - g[free] @ step
            growth = np.linalg.slogdet(h[np.ix_(own, own)])[1]
            assert found[model, i] == pytest.approx(left + growth + 1.5, rel=1e-10)
    product[1] = np.nan  # a row has no equilibrium
    again = fit._evidence(product, columns)
    assert again[:, 0] == pytest.approx(found[:, 0], rel=1e-10) and np.isnan(again[:, 1]).all()
    product[1] = -2.5 * np.eye(7)  # not positive definite
    assert fit._evidence(product, columns) == pytest.approx(fit._solve(product, columns)[0])
