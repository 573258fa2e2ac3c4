"""Fits on the full model, signatures of effects, and smooth columns."""

from dataclasses import replace

import numpy as np
import pytest
from gap_sets import case_of, driven, fit_problem

from soilml.errors import InputError
from soilml.fitting.candidate_effects import with_effect
from soilml.fitting.coordinates import size_coordinate
from soilml.fitting.damped_descents import FINE, levenberg_marquardt
from soilml.fitting.effect_signatures import effect_signatures
from soilml.fitting.least_squares import LeastSquaresProblem
from soilml.fitting.predictions import linearise, predict
from soilml.fitting.readings import stack_readings
from soilml.gap.evidence import problem as problem_module
from soilml.gap.evidence.directions import regions, smooth_basis
from soilml.gap.evidence.problem import StartedFit, fit_many
from soilml.physics.effects import EFFECTS


@pytest.fixture(scope="module")
def clean():
    """A problem on rows without noise."""
    case = case_of()
    return fit_problem(case, driven(case, noise=0.0))


def test_a_soil_without_noise_is_recovered_from_a_far_start(clean):
    found = clean.fit_soil([np.asarray([0.9, 0.1, 0.9])])
    assert found.converged and found.objective < 0.05
    for path, value in found.values().items():
        true = float(getattr(clean.case.soil, path))
        assert abs(value - true) < 0.2 * found.stds()[path]
    np.testing.assert_allclose(found.prediction, clean.readings.measured, rtol=2e-3, atol=2e-3)


def test_a_fit_stops_at_the_bounds_of_the_prior(clean):
    phi = float(clean.case.soil.friction_angle)
    coordinates = [
        replace(a, upper=a.prior.fraction(phi - 0.05)) if a.path == "friction_angle" else a
        for a in clean.soil
    ]
    bounded = LeastSquaresProblem(clean.case, coordinates, clean.readings, clean.covariance.whiten)
    found = levenberg_marquardt(bounded, np.full(3, 0.2))
    assert found.values()["friction_angle"] == pytest.approx(phi - 0.05)
    assert np.all(found.x >= [a.lower for a in coordinates]) and np.all(
        found.x <= [a.upper for a in coordinates]
    )


def test_a_prior_on_a_size_shrinks_it_towards_zero(clean):
    case = clean.with_effects(["torque-gain"])
    offset = size_coordinate(EFFECTS["torque-gain"], None)
    loose, tight = (replace(offset, normal_std=std * offset.prior.upper) for std in (10.0, 1e-3))
    readings = replace(
        clean.readings,
        measured=clean.readings.measured * np.where(clean.readings.channel == 0, 1.03, 1.0),
    )
    sizes = []
    for coordinate in (loose, tight):
        coordinates = [*clean.soil, coordinate]
        problem = LeastSquaresProblem(case, coordinates, readings, clean.covariance.whiten)
        sizes.append(levenberg_marquardt(problem, np.full(4, 0.4)).x[3])
    assert sizes[0] > 20.0 * abs(sizes[1])


def test_derivatives_of_a_fit_are_those_of_the_model(clean):
    x, step = np.asarray([0.3, 0.5, 0.4]), 1e-4
    jacobian = linearise(clean.case, clean.soil, x, clean.readings).jacobian
    for i in range(3):
        sides = np.tile(x, (2, 1))
        sides[:, i] += (step, -step)
        high, low = predict(clean.case, clean.soil, sides, clean.readings)
        central = (high - low) / (2.0 * step)
        np.testing.assert_allclose(
            jacobian[:, i], central, rtol=2e-3, atol=1e-4 * np.abs(central).max()
        )


@pytest.mark.parametrize("name", ["slip-sinkage", "bulldozing", "torque-gain"])
def test_a_signature_is_what_the_effect_does_per_reference_size(clean, name):
    known, _ = effect_signatures(clean.case, clean.readings, {name: EFFECTS[name]})
    (found,) = known
    about = EFFECTS[name].about
    half = clean.case.with_values({}).model + EFFECTS[name](
        **{about.size: 0.5 * about.reference[about.size]}
    )
    force = half(clean.case.soil, clean.readings.at)
    moved = clean.readings.stack(
        {n: np.asarray(getattr(force, n)) for n in clean.readings.channels}
    )
    expected = 2.0 * (moved - clean.readings.measured)
    # far below the noise: fits integrate on fewer points, and signatures end their search early
    np.testing.assert_allclose(
        found.column / clean.readings.std, expected / clean.readings.std, rtol=1e-4, atol=1e-3
    )
    assert found.kind == about.kind


def test_a_signature_agrees_with_the_derivative_of_a_linear_effect(clean):
    known, _ = effect_signatures(
        clean.case, clean.readings, {"torque-gain": EFFECTS["torque-gain"]}
    )
    coordinate = size_coordinate(EFFECTS["torque-gain"], None)
    case = with_effect(clean.case, EFFECTS["torque-gain"])
    jacobian = linearise(case, [coordinate], np.zeros(1), clean.readings).jacobian[:, 0]
    np.testing.assert_allclose(known[0].column, jacobian, rtol=1e-4, atol=1e-9)
    assert known[0].sign == 0


NEEDS = {"rate": "speed_m_s", "multipass": "pass", "lateral-slip": "slip_angle_rad"}


@pytest.mark.parametrize("name, column", NEEDS.items())
def test_an_effect_without_its_covariate_cannot_be_tested(clean, name, column):
    known, untestable = effect_signatures(clean.case, clean.readings, {name: EFFECTS[name]})
    assert known == []
    assert {n: r.text for n, r in untestable.items()} == {name: f"needs the column {column}"}


@pytest.mark.parametrize("name, column", NEEDS.items())
def test_an_effect_with_a_constant_covariate_cannot_be_tested(name, column):
    case = case_of()
    field = EFFECTS[name].about.needs[0]
    for values, tested in (((0.2, 0.2, 0.2), False), ((0.1, 0.2, 0.3), True)):
        if field == "pass_number":
            values = tuple(round(10.0 * v) for v in values)
        table = driven(case, loads=(40.0, 60.0, 90.0), slips=4, **{field: values})
        known, untestable = effect_signatures(
            case, fit_problem(case, table).readings, {name: EFFECTS[name]}
        )
        assert [s.name for s in known] == ([name] if tested else [])
        if not tested:
            assert untestable[name].text == f"needs runs at several values of {column}"


def test_an_effect_that_the_model_has_is_moved_from_its_size():
    case = with_effect(case_of(), EFFECTS["grousers"])
    readings = fit_problem(case_of(), driven(case_of())).readings
    (known,), untestable = effect_signatures(case, readings, {"grousers": EFFECTS["grousers"]})
    assert known.name == "grousers" and untestable == {}


def test_smooth_columns_are_independent_and_of_one_channel_each(clean):
    smooth = smooth_basis(clean.readings)
    touched = [np.unique(clean.readings.channel[column != 0.0]).size for column in smooth.T]
    assert set(touched) == {1}
    scaled = smooth / clean.readings.std[:, None]
    assert np.linalg.matrix_rank(scaled) == smooth.shape[1]


def test_the_smooth_basis_is_legendre_polynomials_between_the_ends_of_slip_and_load():
    readings = stack_readings(case_of(), driven(case_of(), loads=(40.0, 60.0, 90.0), slips=4))
    basis = smooth_basis(readings)
    torque = readings.channel == 0
    own = basis[np.ix_(torque, (basis[torque] != 0.0).any(axis=0))]
    x = 2.0 * (readings.slip[torque] - 0.06) / 0.54 - 1.0
    y = 2.0 * np.log(readings.load[torque] / 40.0) / np.log(90.0 / 40.0) - 1.0
    expected = np.stack([np.ones_like(x), x, y], axis=1)  # 12 readings a channel: 3 functions
    np.testing.assert_allclose(own, np.median(readings.std[torque]) * expected, atol=1e-12)


def test_the_degree_of_the_smooth_basis_follows_the_data():
    case = case_of()
    count = {}
    for name, how in {
        "one load": {"loads": (60.0,) * 4},
        "two loads": {"loads": (40.0, 90.0) * 2},
        "two slips": {"loads": (40.0, 60.0, 90.0, 140.0) * 3, "slips": 2},
    }.items():
        readings = fit_problem(case, driven(case, **how)).readings
        count[name] = smooth_basis(readings).shape[1] // 3
    assert count["one load"] == 5  # 1, s, ..., s^4
    assert count["one load"] < count["two loads"]
    assert count["two slips"] == 5  # 1, w, w^2, s, s w


def test_the_regions_of_the_map_cover_every_reading(clean):
    covered = np.any([region.selected for region in regions(clean.readings)], axis=0)
    assert covered.all()


@pytest.mark.parametrize(
    ("slips", "loads", "bins"),
    [(6, (40.0, 70.0, 100.0), 3), (5, (60.0,), 2), (3, (50.0, 90.0), 1), (8, (40.0, 70.0), 4)],
)
def test_no_slip_is_missing_in_the_map_of_few_rows(slips, loads, bins):
    case = case_of()
    readings = fit_problem(case, driven(case, slips=slips, loads=loads)).readings
    found = regions(readings)
    assert np.any([region.selected for region in found], axis=0).all()
    assert len({region.slip for region in found}) == bins


def test_a_region_holds_the_readings_of_its_channel_slips_and_loads(clean):
    readings, seen = clean.readings, np.zeros(len(clean.readings), dtype=int)
    for region in regions(readings):
        seen += region.selected
        channel = np.asarray(readings.channels)[readings.channel[region.selected]]
        assert set(channel) == {region.channel}
        for values, ends in ((readings.slip, region.slip), (readings.load, region.load)):
            assert (values[region.selected].min(), values[region.selected].max()) == ends
    assert (seen == 1).all()


def test_a_refused_fit_starts_again_without_effects_and_is_refused_once_more(clean, monkeypatch):
    coordinates = [*clean.soil, *clean.size_coordinates(("slip-sinkage",))]
    outcomes = iter(["a fit", InputError("first"), "later", InputError("first"), InputError("no")])
    asked = []

    def descent(problem, start, known=None, tolerance=None):
        yield from ()
        assert problem.coordinates is coordinates and tolerance is FINE
        asked.append(start.tolist())
        outcome = next(outcomes)
        if isinstance(outcome, InputError):
            raise outcome
        return outcome

    monkeypatch.setattr(problem_module, "descent", descent)
    start = {c.path: 0.25 for c in coordinates}
    request = StartedFit(clean.with_effects(("slip-sinkage",)), coordinates, start)
    one, two, refused = fit_many(clean, [request] * 3)
    assert (one, two) == ("a fit", "later") and str(refused) == "no"
    whole, without = [0.25] * len(coordinates), [0.25] * len(clean.soil) + [0.0]
    assert asked == [whole, whole, without, whole, without]


def test_a_calibrated_sensor_has_the_error_that_is_stated(clean):
    """Sizes are in reference sizes; uncalibrated sensors have the usual error of their kind."""
    unit = EFFECTS["torque-gain"].about.reference["gain"]
    known = replace(clean, calibration={"torque-gain": 0.003})
    (size,) = known.size_coordinates(["torque-gain"])
    assert size.std == pytest.approx(0.003 / unit)
    usual, free = clean.size_coordinates(["torque-gain", "slip-sinkage"])
    assert usual.std == problem_module.UNCALIBRATED_STD
    assert free.std == np.inf
