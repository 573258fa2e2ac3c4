"""Steps of a bounded fit: parameters that move by ratios, bounds, and curved valleys."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from gap_sets import MODEL, case_of, driven

from soilml.errors import InputError
from soilml.fitting import damped_descents
from soilml.fitting.coordinates import Coordinate, select_free
from soilml.fitting.damped_descents import (
    COARSE,
    FINE,
    MAX_ITERATIONS,
    MOST_LOG_STEP,
    DampedSteps,
    bounded_steps,
    descend_together,
    descent,
    in_step,
    levenberg_marquardt,
)
from soilml.fitting.least_squares import LeastSquaresProblem, SoilTestTerms, Solution
from soilml.fitting.predictions import Linearisation
from soilml.fitting.readings import Readings, stack_readings
from soilml.numerics.prior import Prior
from soilml.physics.operating_point import Operating


def coordinate(lower: float, upper: float, *, log: bool = False) -> Coordinate:
    """A soil parameter with this uniform prior."""
    return Coordinate("kphi", "", Prior(lower, upper, log=log))


def problem_of(coordinate: Coordinate) -> LeastSquaresProblem:
    """The steps of a problem with one coordinate do not depend on its readings."""
    readings = Readings.of_every_row(Operating(slip=np.zeros(0), load=np.zeros(0)))
    return LeastSquaresProblem(case_of(), [coordinate], readings, np.zeros((0, 0)))


def one_step(of: Coordinate, x: float, residual: float) -> float:
    """Where an undamped step leads whose length in the coordinate is the residual."""
    steps = DampedSteps.of(problem_of(of))
    here, left = np.asarray([x]), np.asarray([residual])
    return float(steps.proposed(here, left, np.eye(1), np.zeros(1))[1][0, 0])


def test_a_wide_positive_parameter_moves_by_ratios():
    wide = coordinate(1e5, 5e6)
    value = wide.prior.at(np.asarray(0.2))
    for step in (-0.1, 0.05):
        moved = wide.prior.at(np.asarray(one_step(wide, 0.2, step)))
        assert moved / value == pytest.approx(np.exp(step * 4.9e6 / value))
    far = wide.prior.at(np.asarray(one_step(wide, 0.01, 0.5)))
    assert far / wide.prior.at(np.asarray(0.01)) == pytest.approx(np.exp(MOST_LOG_STEP))


def test_a_positive_parameter_below_one_moves_by_ratios_too():
    small = coordinate(0.005, 0.04)
    value = small.prior.at(np.asarray(0.2))
    moved = small.prior.at(np.asarray(one_step(small, 0.2, 0.05)))
    assert moved / value == pytest.approx(np.exp(0.05 * 0.035 / value))


def test_other_parameters_move_by_differences():
    for other in (coordinate(0.0, 6e3), coordinate(0.3, 0.8), coordinate(1e5, 5e6, log=True)):
        assert one_step(other, 0.4, 0.25) == pytest.approx(0.65)


def test_steps_end_at_bounds_and_do_not_leave_them():
    of = coordinate(0.0, 1.0)
    assert one_step(of, 0.4, 9.0) == 1.0
    assert one_step(of, 1.0, 0.5) == 1.0
    steps = DampedSteps.of(problem_of(of))

    def promised(x, residual):
        return steps.proposed(np.full(1, x), np.full(1, residual), np.eye(1), np.ones(1))[0]

    assert promised(1.0, 1.0) == 0.0 and promised(0.0, -1.0) == 0.0
    assert promised(1.0, -1.0) == pytest.approx(1.0)
    assert promised(0.5, 1.0) == pytest.approx(0.75)
    assert one_step(of, 0.0, -0.5) == 0.0


@pytest.mark.parametrize(
    ("prior", "std", "optimum", "objective"),
    [
        (Prior(0.0, 1.0), 1.0 / 3.0, 0.1, 0.81 + 0.09),  # (1 - x)^2 + (3 x)^2
        (Prior(-1.0, 1.0), 2.0 / 3.0, 0.55, 0.45**2 + 0.15**2),  # (1 - x)^2 + (3 (x - 1/2))^2
    ],
)
def test_a_step_counts_the_prior(prior, std, optimum, objective):
    """A normal density about the parameter's zero; the readings alone have their optimum at 1."""
    of = Coordinate("kphi", "", prior, normal_std=std, lower=-5.0, upper=5.0)
    problem = problem_of(of)
    steps = DampedSteps.of(problem)
    _, moved = steps.proposed(np.zeros(1), np.ones(1), np.eye(1), np.zeros(1))
    assert moved[0, 0] == pytest.approx(optimum)
    assert problem.objective(1.0 - moved[0], moved[0]) == pytest.approx(objective)


def test_the_objective_counts_tests_of_the_soil():
    """A deviation of 2 x - 1: the optimum of (r - x)^2 + (2 x - 1)^2, from r = 1, is at 0.6."""

    class Tested(LeastSquaresProblem):
        soil_tests = SimpleNamespace(
            case=SimpleNamespace(soil_tests=["a test"]),
            deviation=lambda x: 2.0 * np.asarray(x) - 1.0,
            rates=lambda x: np.asarray([[2.0]]),
        )

    of = Coordinate("kphi", "", Prior(0.0, 1.0), lower=-5.0, upper=5.0)
    problem = Tested(**vars(problem_of(of)))
    steps = DampedSteps.of(problem)
    _, moved = steps.proposed(np.zeros(1), np.ones(1), np.eye(1), np.zeros(1))
    assert moved[0, 0] == pytest.approx(0.6)
    assert problem.objective(np.asarray([0.4]), moved[0]) == pytest.approx(0.16 + 0.04)
    assert problem.objective(np.asarray([2.0]), np.asarray([-1.0])) == pytest.approx(4.0 + 9.0)


def of_soil(case, table):
    """The soil alone, fitted to these rows under their declared noise."""
    readings = stack_readings(case, table)
    whiten = np.diag(1.0 / readings.std)
    return LeastSquaresProblem(case, tuple(select_free(case, None)), readings, whiten)


def test_a_fit_follows_the_valley_of_bearing_modulus_and_exponent():
    """Modulus and exponent of pressure-sinkage compensate each other at the usual sinkage."""
    bearing = "kphi = [100000.0, 5000000.0]\nn = [0.4, 1.6]\n[noise]"
    case = case_of(MODEL.replace("[noise]", bearing))
    own = of_soil(case, driven(case, seed=1))
    truth = [c.prior.fraction(float(getattr(case.soil, c.path))) for c in own.coordinates]
    best = levenberg_marquardt(own, np.asarray(truth))
    for start in (np.full(5, 0.5), np.asarray([0.5, 0.5, 0.3, 0.06, 0.2])):
        found = levenberg_marquardt(own, start)
        assert found.converged
        assert found.objective == pytest.approx(best.objective, abs=0.2)


def test_a_step_that_meets_a_bound_goes_on_in_the_valley():
    """Along the valley u = v the minimum lies at 5; where u ends at 1, v ends nearby."""
    normal = np.asarray([[1.0, -0.99], [-0.99, 1.0]])
    descent = normal @ np.asarray([5.0, 5.0])
    free, low = np.asarray([[True, True], [False, True], [True, True]]), np.full((3, 2), -1.0)
    high = np.asarray([[1.0, 3.0], [1.0, 1.0], [9.0, 9.0]])
    met, held, within = bounded_steps(
        *(np.stack([a] * 3) for a in (normal, descent)), free, low, high
    )
    assert met == pytest.approx([1.0, 5.0 - 0.99 * 4.0])
    assert held == pytest.approx([0.0, descent[1]])
    assert within == pytest.approx([5.0, 5.0])


def test_a_start_with_a_known_linearisation_leads_to_the_same_fit():
    own = of_soil(case_of(), driven(case_of(), seed=2))
    start = np.full(3, 0.3)
    known = own.linearised(start).linearisation
    alone, beside, elsewhere = descend_together(
        [own] * 3, [start, start, np.full(3, 0.6)], [None, known, known]
    )
    assert np.array_equal(alone.x, beside.x) and alone.objective == beside.objective
    assert elsewhere.x == pytest.approx(alone.x, abs=2e-3)


class Slope:
    """A problem whose objective falls by the same in each iteration, and promises far more."""

    coordinates, soil_tests = [coordinate(0.0, 1.0)], SoilTestTerms()
    lower, upper, precision, centre = np.zeros(1), np.full(1, 100.0), np.zeros(1), np.zeros(1)

    def __init__(self, fall):
        self.fall, self.iterates = fall, 0

    def request(self, x, sinkage=None):
        return x

    def at(self, x, linearisation):
        self.iterates += 1
        none = np.zeros((1, 1))
        at = Linearisation(x, none[0], none, none[0], none, none[0])
        objective = 2.0 - self.fall * self.iterates
        return Solution(self, x, at, np.full(1, 0.3), np.full((1, 1), 3.0), objective)

    def whitened(self, prediction):
        return np.full((len(prediction), 1), 0.3)

    def objective(self, residual, x):
        return np.full(len(x), -1e3)


#: As the coarse one, for descents that creep.
CREEPING = replace(FINE, iterations=COARSE.iterations, creeping=COARSE.creeping)


@pytest.mark.parametrize(
    "fall, tolerance, creeps",
    [(0.03, FINE, True), (0.3, FINE, False), (0.3, CREEPING, True), (0.6, CREEPING, False)],
)
def test_a_descent_that_creeps_has_converged(fall, tolerance, creeps):
    slope = Slope(fall)
    work, answer = descent(slope, np.full(1, 0.5), tolerance=tolerance), None
    with pytest.raises(StopIteration) as end:
        while True:
            answer = work.send(answer).request
    assert end.value.value.converged == creeps
    assert slope.iterates == 1 + (tolerance.iterations if creeps else MAX_ITERATIONS)


def test_a_coarse_descent_ends_where_little_is_promised():
    slope = Slope(0.3)  # its linearised model promises less than the coarse tolerance
    work = descent(slope, np.full(1, 0.5), tolerance=COARSE)
    with pytest.raises(StopIteration) as end:
        work.send(work.send(None).request)
    assert end.value.value.converged and slope.iterates == 1


def test_works_share_calls_and_a_refusal_is_raised_where_it_was_asked(monkeypatch):
    calls = []

    def answers(asked):
        calls.append(list(asked))
        return {i: InputError("no") if q == "refused" else q for i, q in asked.items()}

    def work(*questions, caught=False):
        found = []
        for question in questions:
            try:
                found.append((yield question))
            except InputError:
                if not caught:
                    raise
                found.append("caught")
        return found

    monkeypatch.setattr(damped_descents, "_answers", answers)
    works = [work("a"), work("b", "refused", "c", caught=True), work("refused", "d"), work()]
    one, two, three, four = in_step(works)
    assert (one, two, four) == (["a"], ["b", "caught", "c"], [])
    assert isinstance(three, InputError)
    assert calls == [[0, 1, 2], [1], [1]]


@pytest.mark.parametrize(("damping", "along"), [(0.0, 1.0), (0.1, 1.0 / 1.1)])
def test_a_correction_leads_back_to_the_floor_of_a_valley_and_no_further_along_it(damping, along):
    """Of Rosenbrock's valley, y = x^2, from x = y = 0: a step along x leaves it by x^2."""
    of = Coordinate("kphi", "", Prior(0.0, 1.0), lower=-5.0, upper=5.0)
    problem = problem_of(of)
    steps = DampedSteps.of(replace(problem, coordinates=[of, of]))

    def residual(points):
        x, y = points.T
        return np.stack([-100.0 * (y - x**2), 1.0 - x], axis=1)

    start, jacobian = np.zeros(2), np.asarray([[0.0, 100.0], [1.0, 0.0]])
    last = SimpleNamespace(x=start, residual=residual(start[None, :])[0], jacobian=jacobian)
    dampings = np.full(1, damping)
    _, ends = steps.proposed(last.x, last.residual, jacobian, dampings)
    assert ends[0] == pytest.approx([along, 0.0])
    back = steps.corrected(last, ends, residual(ends), dampings)
    assert back[0] == pytest.approx([along, along**2 / (1.0 + damping)])


@pytest.mark.parametrize("gain, trials", [(0.05, 1), (0.04, 2)])  # of 0.09 that are promised
def test_steps_are_corrected_where_none_of_them_keeps_the_promise(gain, trials):
    slope = Slope(0.03)
    slope.objective = lambda _, x: np.full(len(x), 2.0 - 0.03 * slope.iterates - gain)
    work, answer, asked = descent(slope, np.full(1, 0.5)), None, []
    with pytest.raises(StopIteration):
        while True:
            question = work.send(answer)
            asked.append("linearise" if question.linearise else "predict")
            answer = question.request
    assert asked[:2] == ["linearise"] * 2  # the first step is trusted, and disappoints
    assert asked[2 : 3 + trials] == ["predict"] * trials + ["linearise"]
