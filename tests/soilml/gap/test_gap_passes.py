"""Passes of the analysis: covariance, outliers and search in turn, and when they end."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from gap_sets import case_of, driven, fit_problem

from soilml.fitting.coordinates import Coordinate, free_soil_parameters
from soilml.fitting.least_squares import LeastSquaresProblem, Solution
from soilml.fitting.predictions import Linearisation
from soilml.fitting.readings import Readings
from soilml.gap import gap
from soilml.gap.evidence.covariance import VarianceComponents
from soilml.gap.search import analysis
from soilml.gap.search import passes as module
from soilml.gap.search import without_outliers as rounds
from soilml.gap.search.opened_priors import OpenedPriors
from soilml.gap.search.stepwise import SearchResult
from soilml.numerics.prior import Prior
from soilml.physics.operating_point import Operating
from soilml.quantities import column
from soilml.remarks import Remark

CASE = case_of()
READINGS = fit_problem(CASE, driven(CASE)).readings


@pytest.fixture
def passes(monkeypatch):
    """Passes whose components and accepted fits are listed; what they were given.

    Outliers are listed by the number of readings that are excluded; the explanation that accounts
    for them leaves none.
    """
    given = SimpleNamespace(
        outliers={}, components=[], accepted=[], seen=[], starts=[], explained=False, accounts=None
    )

    def reestimate(problem, fit, signatures):
        i = len(given.seen)
        given.seen.append((fit, len(problem.readings), tuple(signatures)))
        scale = given.components[i] if i < len(given.components) else 1.0
        components = replace(problem.covariance.components, noise_scale=np.full(3, scale))
        return replace(problem, covariance=replace(problem.covariance, components=components))

    def outliers_of(problem, own, fit, signatures, excluded, cleared):
        found = excluded & (not given.explained)
        if fit != ("fit of", given.accounts):
            found[np.flatnonzero(~excluded)[given.outliers.get(int(excluded.sum()), [])]] = True
        return found & ~cleared, cleared | (excluded & ~found)

    def search(problem, soil, seed, starts, progress=lambda _: None, begun=None):
        progress(0.5)
        given.starts.append(sorted(starts))
        names = given.accepted[len(given.starts) - 1]
        explained = SimpleNamespace(names=names, fit=("fit of", names), amplitude=None)
        accepted = () if names is None else (explained,)
        result = module.no_result(soil)
        signature = SimpleNamespace(column=np.zeros(len(problem.readings)))
        test = replace(result.final_test, signatures=(signature,))
        return replace(result, accepted=accepted, candidates=accepted, final_test=test)

    def settled(problem, result, excluded, cleared):
        return excluded, cleared, result.best

    def first_look(problem, soil, *_, **__):
        return module.no_result(soil)

    monkeypatch.setattr(module, "with_estimated_covariance", reestimate)
    monkeypatch.setattr(module, "first_look", first_look)
    monkeypatch.setattr(module, "search", search)
    monkeypatch.setattr(rounds, "search", search)
    monkeypatch.setattr(rounds, "_outliers_of", outliers_of)
    monkeypatch.setattr(rounds, "_settled", settled)

    def run(case=CASE, readings=READINGS):
        shares = []
        free = free_soil_parameters(case, None)
        place = "row {}".format
        found = analysis.analyse(case, free, readings, {}, {}, 0, place, shares.append)
        return found, shares

    return given, run


def test_a_second_pass_uses_the_residuals_of_the_best_explanation(passes):
    given, run = passes
    given.components, given.accepted = [1.0, 1.3], [("a",), ("b",)]
    found, shares = run()
    assert [fit for fit, _, _ in given.seen][1] == ("fit of", ("a",))
    assert isinstance(given.seen[0][0], Solution) and given.seen[0][2] == ()
    assert len(given.seen[1][2]) == 1  # the signatures of the last test of residuals
    assert given.starts == [[], [("a",)]]
    assert found.result.accepted[0].names == ("b",) and found.error is None
    assert shares == [0.25, 0.75]


def test_no_second_search_where_the_covariance_has_converged(passes):
    given, run = passes
    given.components, given.accepted = [1.0, 1.1], [("a",), ("b",)]
    found, _ = run()
    assert len(given.seen) == 2 and len(given.starts) == 1
    assert found.result.accepted[0].names == ("a",)
    assert found.problem.covariance.components.noise_scale.tolist() == [1.1] * 3


def test_readings_that_stray_from_the_explanation_are_excluded_and_searched_again(passes):
    given, run = passes
    given.accepted = [None, None, None]
    given.outliers = {0: [4], 1: [6]}
    found, _ = run()
    where = [(READINGS.channels[READINGS.channel[i]], READINGS.row[i]) for i in (4, 7)]
    assert found.outliers == tuple(f"{column(name)} at row {row}" for name, row in where)
    assert len(given.starts) == 3 and len(found.problem.readings) == len(READINGS) - 2
    assert found.of_all is not None and len(found.of_all.problem.readings) == len(READINGS)


def test_readings_that_stray_from_single_effects_are_searched_with_larger_sets_first(passes):
    given, run = passes
    given.outliers, given.accounts = {0: [4]}, ("a", "b")
    given.accepted = [("a", "b"), ("a", "b")]
    found, _ = run()
    assert found.outliers == () and found.of_all is None
    assert len(given.starts) == 2  # with the covariance of the first look, and to the end


def test_a_reading_that_the_explanation_of_the_others_predicts_is_taken_back(passes):
    given, run = passes
    given.accepted, given.outliers, given.explained = [None] * 4, {0: [4]}, True
    found, _ = run()
    assert found.outliers == () and len(found.problem.readings) == len(READINGS)
    assert len(given.starts) == 3  # it strays from the fit to all again, and stays


def test_without_a_gap_there_is_one_pass(passes):
    given, run = passes
    given.accepted = [None]
    found, _ = run()
    assert len(given.seen) == 1 and found.result.accepted == ()


@pytest.mark.parametrize("count, too_many", [(9, False), (10, True)])
def test_more_than_a_tenth_of_outliers_is_bad_data(passes, count, too_many):
    given, run = passes
    given.accepted = [None, None]
    assert len(READINGS) == 96
    given.outliers = {0: list(range(count))}
    found, _ = run()
    names = [f"torque_Nm at row {row}" for row in range(3)]
    said = f"{count} readings are outliers: check the sensors first: {', '.join(names)} and 7 more"
    assert str(found.error) == (said if too_many else "None")
    assert not too_many or len(found.error.about) == count
    assert (found.outliers == ()) == too_many


def test_a_load_that_the_model_cannot_carry_is_bad_data(passes):
    _, run = passes
    heavy = replace(READINGS.at, load=np.where(np.arange(32) == 5, 9e6, READINGS.at.load))
    found, _ = run(readings=replace(READINGS, at=heavy))
    assert str(found.error) == "the model cannot carry the load of row 5"
    no_peak = replace(case_of().soil, a0=0.0, a1=0.0)
    found, _ = run(case=replace(case_of(), soil=no_peak))
    assert str(found.error).startswith("row 0: no stress profile")
    assert isinstance(found.result, SearchResult) and not found.result.has_gap


TEST_ALONE, LIKELIEST, FIRST = (False, "none"), (True, "none"), (True, "first")
FURTHER = "the same look goes on"


@pytest.mark.parametrize(
    "rival, complete, freed, near, expected",
    [
        (("a",), True, True, False, [TEST_ALONE]),
        (("a",), True, False, True, [TEST_ALONE]),
        (("a",), False, True, False, [FIRST]),
        (("a", "b"), True, True, True, [FIRST, FURTHER]),
        (("a",), False, False, False, [LIKELIEST]),
        (("a",), False, False, True, [LIKELIEST, FURTHER]),
        (("a", "b"), True, False, True, [LIKELIEST, FURTHER]),
    ],
)
def test_effects_are_fitted_with_opened_priors_where_they_can_count(
    passes, monkeypatch, rival, complete, freed, near, expected
):
    """None where one alone explains all; the first where more parameters are free than before."""
    given, run = passes
    given.accepted, asked = [None], []
    soil = fit_problem(CASE, driven(CASE)).fit_soil([np.full(3, 0.5)])
    gap_test = SimpleNamespace(p_value=0.001)
    look = replace(module.no_result(soil), soil_test=gap_test, candidates=(None,))
    free = tuple(free_soil_parameters(CASE, None))
    more = (*free, free[0]) if freed else free
    opened = OpenedPriors(CASE, more, Remark("prior-opened", ""))
    begun = module.Analysis(soil.problem, look), {}

    def begin(*_, likeliest=False, singles="all"):
        asked.append((likeliest, singles))
        return begun

    def with_singles(same, seed):
        assert same is begun
        asked.append(FURTHER)
        return begun

    monkeypatch.setattr(analysis, "open_priors", lambda *_: opened)
    monkeypatch.setattr(analysis, "begin", begin)
    monkeypatch.setattr(analysis, "with_singles", with_singles)
    monkeypatch.setattr(analysis, "_rival", lambda found: SimpleNamespace(names=rival))
    monkeypatch.setattr(analysis, "is_complete", lambda *_: complete)
    monkeypatch.setattr(
        analysis, "explains_better", lambda found, other, c, lacking=0.0: near and lacking > 0.0
    )
    run()
    assert asked == expected


@pytest.mark.parametrize(
    "has_gap, better, searches", [(True, False, 1), (True, True, 2), (False, False, 2)]
)
def test_opened_priors_are_searched_in_full_where_the_first_look_permits_that_they_count(
    passes, monkeypatch, has_gap, better, searches
):
    given, run = passes
    given.accepted = [None, None]
    p_value = SimpleNamespace(p_value=0.001 if has_gap else 0.5)
    look = replace(module.no_result(None), candidates=(SimpleNamespace(names=("a",)),))
    look = replace(look, soil=fit_problem(CASE, driven(CASE)).fit_soil([np.full(3, 0.5)]))
    look = module.Analysis(look.soil.problem, replace(look, soil_test=p_value))
    free = free_soil_parameters(CASE, None)
    opened = OpenedPriors(CASE, tuple(free), Remark("prior-opened", "the priors were opened"))
    for name, value in {
        "open_priors": lambda *_: opened,
        "begin": lambda *_, **__: (look, {}),
        "with_singles": lambda begun, seed: begun,
        "_rival": lambda found: SimpleNamespace(names=()),
        "explains_better": lambda *_: better,
        "_explained_by_soil": lambda found, _: found,
    }.items():
        monkeypatch.setattr(analysis, name, value)
    found, _ = run()
    assert len(given.starts) == searches
    assert (found.opened is not None) == (searches == 2)  # the stubs find no gap in full


@pytest.mark.parametrize("value, better", [(-9.1, True), (-8.9, False)])
def test_an_explanation_with_opened_priors_is_better_by_9(monkeypatch, value, better):
    evidence = SimpleNamespace(evidence=lambda *_: SimpleNamespace(value=value))
    problem = SimpleNamespace(readings=READINGS, discrepancy=evidence)
    found = SimpleNamespace(problem=problem, error=None)
    rival = SimpleNamespace(objective=0.0, amplitude=np.zeros(3))
    monkeypatch.setattr(analysis, "_rival", lambda _: rival)
    own = SimpleNamespace(names=("a",), fit=None, amplitude=np.zeros(3), penalty=0.0)
    assert analysis.explains_better(found, found, own) == better


def test_the_declared_noise_is_where_the_analysis_begins():
    found = module.declared_covariance(READINGS)
    assert np.diag(found.matrix) == pytest.approx(READINGS.std**2)
    assert not (found.matrix - np.diag(np.diag(found.matrix))).any()
    known = found.components
    assert known.noise_scale.tolist() == [1.0] * 3 and known.degrees_of_freedom == 1.0
    assert known.friction_angle_std == known.bearing_std == known.autocorrelation == 0.0
    assert isinstance(known, VarianceComponents)


def test_an_analysis_without_a_search_has_no_gap():
    found = module.no_result(None)
    assert found.soil_test.p_value >= 0.5 and not found.has_gap
    assert found.soil_alone is None and found.likeliest is None


def test_smoothed_residuals_are_those_of_generalised_least_squares():
    problem = fit_problem(CASE, driven(CASE))
    rng = np.random.default_rng(0)
    space = rng.standard_normal((96, 5)) * problem.covariance.std[:, None]
    residual = rng.standard_normal(96) * problem.covariance.std
    inverse = np.linalg.inv(problem.covariance.matrix)
    weights = np.linalg.solve(space.T @ inverse @ space, space.T @ inverse @ residual)
    found = module._gls_prediction(problem.covariance, residual, space)
    assert found == pytest.approx(space @ weights, rel=1e-6, abs=1e-12)
    again = module._gls_prediction(problem.covariance, residual, np.tile(space, 2))
    assert again == pytest.approx(found, rel=1e-6, abs=1e-12)  # nearly collinear columns


def test_the_covariance_is_estimated_from_what_a_fit_leaves():
    """Noise at a smoothed prediction, and outliers by signatures that fit the readings."""
    case = case_of()
    table = driven(case, seed=3)
    table.columns["torque_Nm"][12] *= 1.1
    problem = fit_problem(case, table)
    soil = problem.fit_soil([np.full(3, 0.5)])
    small = replace(problem, effects={"slip-sinkage": problem.effects["slip-sinkage"]})
    stray = rounds._strays_from(small, soil, ())(np.ones(96, dtype=np.bool_))
    assert np.flatnonzero(stray).tolist() == [
        int(i)
        for i in np.flatnonzero(problem.readings.channel == 0)
        if problem.readings.row[i] == 12
    ]
    kept = module.of_readings(small, ~stray)
    found = module.with_estimated_covariance(kept, kept.fit_soil([soil.x]), ())
    assert len(found.readings) == len(found.covariance.std) == 95
    torque = found.readings.channel == 0
    expected = np.delete(soil.prediction[problem.readings.channel == 0], 12)
    assert found.readings.std[torque] == pytest.approx(0.01 * expected, rel=0.2)
    assert np.all(found.covariance.components.noise_scale < 1.3)


@pytest.fixture(scope="module")
def two_outliers():
    """A problem of 96 readings of which two are wrong, the fit to the others, and which they are.

    A third reading was excluded too, and is right.
    """
    case = case_of()
    table = driven(case, seed=3)
    table.columns["torque_Nm"][12] *= 1.1
    table.columns["torque_Nm"][20] *= 1.6
    problem = fit_problem(case, table)
    problem = replace(problem, effects={"slip-sinkage": problem.effects["slip-sinkage"]})
    torque, row = problem.readings.channel == 0, problem.readings.row
    wrong, excluded = (torque & np.isin(row, rows) for rows in ([12, 20], [12, 20, 27]))
    kept = module.of_readings(problem, ~excluded)
    return problem, kept.fit_soil([np.full(3, 0.5)]), wrong, excluded


def test_an_excluded_reading_is_judged_alone_and_cleared_for_good_where_it_does_not_stray(
    two_outliers,
):
    problem, fit, wrong, excluded = two_outliers
    none = np.zeros(96, dtype=np.bool_)
    kept = module.of_readings(problem, ~excluded)
    found, cleared = rounds._outliers_of(problem, kept, fit, (), excluded, none)
    assert np.array_equal(found, wrong) and np.array_equal(cleared, excluded & ~wrong)
    again, _ = rounds._outliers_of(problem, kept, fit, (), wrong, cleared | wrong)
    assert not again.any()


def by_soil(fit, signatures=()):
    """The result of a search whose best explanation is this fit."""
    test = SimpleNamespace(signatures=signatures)
    return SimpleNamespace(best=fit, accepted=(), final_test=test)


def test_the_outliers_of_an_explanation_settle_without_a_search(two_outliers):
    problem, fit, wrong, excluded = two_outliers
    none, largest = np.zeros(96, dtype=np.bool_), wrong & (problem.readings.row == 20)
    all_of_them = problem.fit_soil([np.full(3, 0.5)])
    # a lesser one strays too, but less than half as far
    stray = rounds._strays_from(problem, all_of_them, ())(~none)
    assert np.array_equal(stray, largest)
    result = by_soil(all_of_them, problem.signatures_beside(all_of_them))
    found, cleared, last = rounds._settled(problem, result, largest, none)
    assert np.array_equal(found, wrong) and not cleared.any()
    assert len(last.prediction) == 94
    found, cleared, _ = rounds._settled(problem, by_soil(fit), excluded, none)
    assert np.array_equal(found, wrong) and np.array_equal(cleared, excluded & ~wrong)


def test_a_fit_states_precision_and_covariance_of_its_parameters():
    rng = np.random.default_rng(0)
    jacobian = rng.standard_normal((9, 2))
    angle = Coordinate("friction_angle", "rad", Prior(0.4, 0.8))
    other = Coordinate("cohesion", "Pa", Prior(0.0, 2000.0), normal_std=500.0)
    x, none = np.asarray([0.25, 0.5]), np.zeros(9)
    at = Operating(slip=np.full(9, 0.2), load=np.full(9, 60.0))
    readings = Readings.of_every_row(at, ["torque"], measured=np.ones(9))
    fit = Solution(
        LeastSquaresProblem(CASE, (angle, other), readings, np.eye(9)),
        x,
        Linearisation(x, none, jacobian, none, np.zeros((2, 9)), none),
        *(none, jacobian, 0.0, True),
    )
    assert fit.precision.tolist() == [0.0, 16.0]
    covariance = np.linalg.inv(jacobian.T @ jacobian + np.diag([12.0, 16.0]))
    assert fit.covariance == pytest.approx(covariance)
    assert fit.values() == {"friction_angle": pytest.approx(0.5), "cohesion": 1000.0}
    stds = np.sqrt(np.diag(covariance)) * [0.4, 2000.0]
    assert fit.stds() == {
        "friction_angle": pytest.approx(stds[0]),
        "cohesion": pytest.approx(stds[1]),
    }
    assert fit.start_values() == {"friction_angle": 0.25, "cohesion": 0.5}
    assert fit.fitted().soil.cohesion == 1000.0
    white = fit.whitened_by(2.0 * np.eye(9))
    assert white.residual == pytest.approx(np.full(9, 2.0))
    assert white.jacobian == pytest.approx(2.0 * jacobian)


def test_the_report_on_bad_data_has_its_reasons_and_the_case():
    report = gap(CASE, driven(CASE, loads=(60.0,), slips=2), seed=7)
    assert report.status == "bad-data" and report.model == CASE and report.seed == 7
    assert "6 readings for 3 soil parameters" in report.reasons[0].text
    assert report.sentence.startswith(report.reasons[0].text)
    assert report.cause_set == report.effects == ()
