"""Fits beside a discrepancy: when they are repeated, and amplitudes over their probability."""

from dataclasses import dataclass, field, replace
from types import SimpleNamespace

import numpy as np
import pytest

from soilml.errors import InputError
from soilml.fitting.coordinates import Coordinate
from soilml.fitting.damped_descents import FINE
from soilml.gap.evidence import problem as problem_module
from soilml.gap.evidence.linearised_fit import AMPLITUDES
from soilml.gap.evidence.marginal_likelihood import (
    SMALLEST_SIZE,
    Evidence,
    _expected_amplitude,
    _prior,
    _size_prior,
)
from soilml.gap.evidence.problem import fit_marginal
from soilml.numerics.prior import Prior


@dataclass(frozen=True)
class Started:
    """A fit to be made, known by its name."""

    name: str
    coordinates: tuple = ()
    start: dict = field(default_factory=dict)
    whiten: object = None
    near: object = None
    useful: float = np.inf


@pytest.fixture
def fitting(monkeypatch):
    """Fits give, each time, the next value and amplitude that are listed under their name.

    The last ones stay.
    """
    listed, asked = {}, []

    def fit(problem, started, tolerance):
        yield from ()
        asked.append((started.name, started.start, started.whiten, tolerance is FINE))
        if isinstance(listed[started.name], InputError):
            raise listed[started.name]
        start = {"from": started.name, "fit": len(asked)}
        return SimpleNamespace(name=started.name, start_values=lambda: start, linearisation=None)

    def evidence(fit, amplitude):
        own = listed[fit.name]
        value, found = own.pop(0) if len(own) > 1 else own[0]
        return Evidence(value, np.asarray([found]), np.zeros(0), np.asarray([found]))

    monkeypatch.setattr(problem_module, "_fit", fit)
    discrepancy = SimpleNamespace(evidence=evidence, whiten=lambda amplitude: float(amplitude[0]))
    return SimpleNamespace(discrepancy=discrepancy), listed, asked


def names(asked):
    return [name for name, *_ in asked]


def started(name, path=None):
    """A fit of a coordinate of its own, or of one that others have too."""
    return Started(name, (SimpleNamespace(path=path or name),))


def test_a_fit_is_repeated_from_its_optimum_until_its_amplitude_stays(fitting):
    problem, listed, asked = fitting
    listed |= {"steady": [(5.0, 0.2)], "moves": [(9.0, 1.0), (7.0, 2.5), (6.5, 2.4)]}
    requests = [(started(name), np.zeros(1)) for name in listed]
    steady, moves = fit_marginal(problem, requests)
    assert names(asked) == ["steady", "steady", "moves", "moves", "moves"]
    assert [whiten for _, _, whiten, _ in asked] == [0.0, 0.0, 0.0, 1.0, 2.5]
    assert asked[4][1] == {"from": "moves", "fit": 4}
    assert (steady.evidence.value, moves.evidence.value) == (5.0, 6.5)
    assert moves.first.start_values() and moves.first is not moves.fit


def test_a_fit_is_made_four_times_at_most(fitting):
    problem, listed, asked = fitting
    listed["restless"] = [(9.0, 1.0), (8.0, 3.0), (7.0, 9.0), (6.0, 25.0), (5.0, 90.0)]
    (found,) = fit_marginal(problem, [(started("restless"), np.zeros(1))])
    assert len(asked) == 4 and found.evidence.value == 6.0


@pytest.mark.parametrize("above, again", [(39.9, True), (40.1, False)])
def test_a_fit_far_above_the_best_is_not_repeated(fitting, above, again):
    problem, listed, asked = fitting
    listed |= {"best": [(5.0, 0.0)], "poor": [(5.0 + above, 1.0)]}
    fit_marginal(problem, [(started(name), np.zeros(1)) for name in listed])
    assert names(asked)[2:] == ["poor"] * (1 + again)
    asked.clear()
    fit_marginal(problem, [(started("poor"), np.zeros(1))], lowest=5.0)
    assert len(asked) == 1 + again


def test_fits_near_the_best_go_on_to_a_fine_tolerance(fitting):
    problem, listed, asked = fitting
    listed |= {"best": [(5.0, 0.0)], "near": [(19.9, 0.0)], "far": [(20.1, 0.0)]}
    listed |= {"becomes-near": [(20.1, 1.0), (6.0, 1.0)]}
    fit_marginal(problem, [(started(name), np.zeros(1)) for name in listed])
    fine = {name: [fine for own, *_, fine in asked if own == name] for name in listed}
    assert fine == {
        "best": [False, True],
        "near": [False, True],
        "far": [False],
        "becomes-near": [False, False, True],
    }


@pytest.mark.parametrize("above, rounds", [(-0.2, 2), (0.0, 1)])
def test_of_several_starts_of_one_set_the_best_is_made_fine(fitting, above, rounds):
    problem, listed, asked = fitting
    listed |= {"one": [(5.0, 0.0)], "other": [(5.0 + above, 0.0)]}
    fit_marginal(problem, [(started(name, "same"), np.zeros(1)) for name in listed])
    assert names(asked) == ["one", "one", *["other"] * rounds]


@pytest.mark.parametrize("above, rounds", [(9.9, 2), (10.1, 1)])
def test_a_start_that_is_worse_than_another_of_its_set_is_not_repeated(fitting, above, rounds):
    problem, listed, asked = fitting
    listed |= {"one": [(5.0, 0.0)], "other": [(5.0 + above, 1.0)]}
    fit_marginal(problem, [(started(name, "same"), np.zeros(1)) for name in listed])
    assert names(asked) == ["one", "one", *["other"] * rounds]


@pytest.mark.parametrize("useful, fine", [(4.9, False), (5.1, True)])
def test_a_fit_that_will_not_count_stays_coarse(fitting, useful, fine):
    problem, listed, asked = fitting
    listed["one"] = [(5.0, 0.2)]
    request = replace(started("one"), useful=useful)
    fit_marginal(problem, [(request, np.zeros(1))])
    assert [fine for *_, fine in asked] == [False, True][: 1 + fine]


def test_fits_that_the_model_refuses_or_that_have_no_equilibrium_are_none(fitting):
    problem, listed, _ = fitting
    listed |= {"refused": InputError("no"), "unsolved": [(np.nan, 1.0)], "good": [(1.0, 0.0)]}
    found = fit_marginal(problem, [(started(name), np.zeros(1)) for name in listed])
    assert found[0] is None and found[1] is None and found[2].evidence.value == 1.0


def test_amplitudes_are_root_mean_squares_over_their_tempered_probability():
    """Half of the difference of -2 ln p counts, and of each channel with the other at its best."""
    values = {0: (AMPLITUDES - 1.0) ** 2, 1: 3.0 * (AMPLITUDES - 0.4) ** 2}
    problem = SimpleNamespace(along=lambda amplitude, i: values[i])
    found = _expected_amplitude(problem, np.asarray([1.0, 0.4]), {})
    for i, value in values.items():
        weight = np.exp(-0.25 * value)
        assert found[i] ** 2 == pytest.approx(np.average(AMPLITUDES**2, weights=weight))


def size(lower, std=None):
    return Coordinate("dig.n1", "1", Prior(0.0, 1.0), normal_std=std, lower=lower, upper=9.0)


def test_priors_of_coordinates_as_precision_slope_and_value():
    """Of a uniform prior, the variance 1/12; of a Gaussian one, -2 ln p less ln 2 pi."""
    assert _prior(Coordinate("c", "Pa", Prior(0.0, 1.0)), 0.3) == (12.0, 0.0, 0.0)
    precision, pull, value = _prior(size(-9.0, std=0.5), 0.7)
    assert (precision, pull) == (pytest.approx(4.0), pytest.approx(4.0 * 0.7))
    assert value == pytest.approx((0.7 / 0.5) ** 2 + 2.0 * np.log(0.5))
    for x in (0.2, 7.0):
        assert _prior(size(0.0), x) == _size_prior(x, two_sided=False)
        assert _prior(size(-9.0), x) == _size_prior(x, two_sided=True)


@pytest.mark.parametrize("x, power", [(0.3, 1.0), (-0.3, 1.0), (5.0, 1.0), (7.0, 3.0)])
def test_the_density_of_a_size_falls_with_its_first_and_beyond_usual_ones_third_power(x, power):
    precision, slope, value = _size_prior(x, two_sided=True)
    shifted = abs(x) + SMALLEST_SIZE
    assert precision == pytest.approx(power / shifted**2)
    assert slope == pytest.approx(power * np.sign(x) / shifted)
    density = 1.0 / (2.0 * shifted * np.log(1.0 + 5.0 / 0.01))
    if abs(x) > 5.0:
        density *= (5.01 / shifted) ** 2
    assert value == pytest.approx(-2.0 * np.log(density) - np.log(2.0 * np.pi))
