"""Fits on the full model, signatures of effects, and smooth columns."""

from dataclasses import replace

import numpy as np
import pytest
from gap_sets import bench_of, case_of, driven

from soilml.gap.statistics.coordinates import linearised, predicted, size_axis
from soilml.gap.statistics.least_squares import descend
from soilml.gap.statistics.signatures import grown, signatures
from soilml.gap.statistics.smooth_basis import distinct, places, smooth_columns
from soilml.physics.effects import EFFECTS


@pytest.fixture(scope="module")
def clean():
    """A bench on rows without noise."""
    case = case_of()
    return bench_of(case, driven(case, noise=0.0))


def test_a_soil_without_noise_is_recovered_from_a_far_start(clean):
    found = clean.soil_only([np.asarray([0.9, 0.1, 0.9])])
    assert found.converged and found.cost < 0.05
    for path, value in found.values().items():
        true = float(getattr(clean.case.soil, path))
        assert abs(value - true) < 0.2 * found.stds()[path]
    np.testing.assert_allclose(found.prediction, clean.cells.reading, rtol=2e-3, atol=2e-3)


def test_a_fit_stops_at_the_bounds_of_the_prior(clean):
    phi = float(clean.case.soil.friction_angle)
    axes = [
        replace(a, upper=a.prior.fraction(phi - 0.05)) if a.path == "friction_angle" else a
        for a in clean.soil
    ]
    found = descend(clean.case, axes, clean.cells, clean.covariance.whiten, np.full(3, 0.2))
    assert found.values()["friction_angle"] == pytest.approx(phi - 0.05)
    assert np.all(found.x >= [a.lower for a in axes]) and np.all(found.x <= [a.upper for a in axes])


def test_a_prior_on_a_size_draws_it_towards_zero(clean):
    case = clean.with_effects(["torque-gain"])
    offset = size_axis(EFFECTS["torque-gain"], None)
    loose, tight = (replace(offset, std=std) for std in (10.0, 1e-3))
    cells = replace(
        clean.cells, reading=clean.cells.reading * np.where(clean.cells.channel == 0, 1.03, 1.0)
    )
    sizes = []
    for axis in (loose, tight):
        axes = [*clean.soil, axis]
        start = np.full(4, 0.4)
        sizes.append(descend(case, axes, cells, clean.covariance.whiten, start).x[3])
    assert sizes[0] > 20.0 * abs(sizes[1])


def test_derivatives_of_a_fit_are_those_of_the_model(clean):
    x, step = np.asarray([0.3, 0.5, 0.4]), 1e-4
    slope = linearised(clean.case, clean.soil, x, clean.cells)[1]
    for i in range(3):
        sides = np.tile(x, (2, 1))
        sides[:, i] += (step, -step)
        high, low = predicted(clean.case, clean.soil, sides, clean.cells)
        central = (high - low) / (2.0 * step)
        np.testing.assert_allclose(
            slope[:, i], central, rtol=2e-3, atol=1e-4 * np.abs(central).max()
        )


@pytest.mark.parametrize("name", ["slip-sinkage", "bulldozing", "torque-gain"])
def test_a_signature_is_what_the_effect_does_per_reference_size(clean, name):
    known, _ = signatures(clean.case, clean.cells, {name: EFFECTS[name]})
    (found,) = known
    about = EFFECTS[name].about
    half = clean.case.with_values({}).model + EFFECTS[name](
        **{about.size: 0.5 * about.reference[about.size]}
    )
    force = half(clean.case.soil, clean.cells.at)
    moved = clean.cells.of({n: np.asarray(getattr(force, n)) for n in clean.cells.channels})
    np.testing.assert_allclose(
        found.column, 2.0 * (moved - clean.cells.reading), rtol=1e-6, atol=1e-9
    )
    assert found.kind == about.kind


def test_a_signature_agrees_with_the_derivative_of_a_linear_effect(clean):
    known, _ = signatures(clean.case, clean.cells, {"torque-gain": EFFECTS["torque-gain"]})
    axis = size_axis(EFFECTS["torque-gain"], None)
    case = grown(clean.case, EFFECTS["torque-gain"])
    slope = linearised(case, [axis], np.zeros(1), clean.cells)[1][:, 0]
    np.testing.assert_allclose(known[0].column, slope, rtol=1e-4, atol=1e-9)
    assert known[0].sign == 0


NEEDS = {"rate": "speed_m_s", "multipass": "pass", "lateral-slip": "slip_angle_rad"}


@pytest.mark.parametrize("name, column", NEEDS.items())
def test_an_effect_whose_covariate_nobody_measured_cannot_be_tested(clean, name, column):
    known, cannot = signatures(clean.case, clean.cells, {name: EFFECTS[name]})
    assert known == []
    assert [(u.name, u.reason) for u in cannot] == [(name, f"needs the column {column}")]


@pytest.mark.parametrize("name, column", NEEDS.items())
def test_an_effect_whose_covariate_never_varied_cannot_be_tested(name, column):
    case = case_of()
    field = EFFECTS[name].about.needs[0]
    for values, tested in (((0.2, 0.2, 0.2), False), ((0.1, 0.2, 0.3), True)):
        if field == "pass_number":
            values = tuple(round(10.0 * v) for v in values)
        table = driven(case, loads=(40.0, 60.0, 90.0), slips=4, **{field: values})
        known, cannot = signatures(case, bench_of(case, table).cells, {name: EFFECTS[name]})
        assert [s.name for s in known] == ([name] if tested else [])
        if not tested:
            assert cannot[0].reason == f"needs runs at several values of {column}"


def test_an_effect_that_the_model_has_is_moved_from_its_size():
    case = grown(case_of(), EFFECTS["grousers"])
    cells = bench_of(case_of(), driven(case_of())).cells
    (known,), cannot = signatures(case, cells, {"grousers": EFFECTS["grousers"]})
    assert known.name == "grousers" and cannot == []


def test_smooth_columns_touch_one_channel_each_and_are_free_of_each_other(clean):
    smooth = smooth_columns(clean.cells)
    touched = [np.unique(clean.cells.channel[column != 0.0]).size for column in smooth.T]
    assert set(touched) == {1}
    scaled = smooth / clean.cells.std[:, None]
    assert np.linalg.matrix_rank(scaled) == smooth.shape[1]


def test_the_degree_of_smooth_columns_is_what_was_driven():
    case = case_of()
    count = {}
    for name, how in {
        "one load": {"loads": (60.0,) * 4},
        "two loads": {"loads": (40.0, 90.0) * 2},
        "two slips": {"loads": (40.0, 60.0, 90.0, 140.0) * 3, "slips": 2},
    }.items():
        cells = bench_of(case, driven(case, **how)).cells
        count[name] = smooth_columns(cells).shape[1] // 3
    assert count["one load"] == 5  # 1, s, ..., s^4
    assert count["one load"] < count["two loads"]
    assert count["two slips"] == 5  # 1, w, w^2, s, s w


def test_values_close_together_count_as_one():
    assert distinct(np.asarray([1.0, 1.0, 1.0])) == 1
    assert distinct(np.asarray([0.0, 0.001, 1.0])) == 2
    assert distinct(np.asarray([0.0, 0.5, 1.0])) == 3


def test_the_places_of_the_map_cover_every_cell(clean):
    covered = np.any([place.cells for place in places(clean.cells)], axis=0)
    assert covered.all()
