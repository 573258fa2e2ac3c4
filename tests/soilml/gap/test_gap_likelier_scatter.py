"""Scatter between runs takes the place of an effect that follows the runs, where it is likelier."""

from types import SimpleNamespace

import numpy as np
import pytest
from gap_sets import case_of, driven, fit_problem

from soilml.gap.evidence.problem import StartedFit, fit_marginal
from soilml.gap.search.explanation import Explanation
from soilml.gap.search.likelier_scatter import with_likelier_scatter
from soilml.io.table import Table

RUNS, SLIPS = 8, 6


def searched(true_angles, names=("friction-drift",)):
    """A problem without scatter; the soil alone and an effect, fitted to runs of these soils."""
    case = case_of()
    soils = {"friction_angle": case.soil.friction_angle + np.asarray(true_angles)}
    table = driven(case, loads=(80.0,) * RUNS, slips=SLIPS, soils=soils)
    columns = dict(table.columns) | {"progress": np.repeat(np.linspace(0.0, 1.0, RUNS), SLIPS)}
    problem = fit_problem(case, Table(columns))
    none, found = np.zeros(len(problem.readings.channels)), []
    for own in ((), names):
        coordinates = [*problem.soil, *problem.size_coordinates(own)]
        start = StartedFit(problem.with_effects(own), coordinates, {})
        (fit,) = fit_marginal(problem, [(start, none)])
        found.append(Explanation(own, fit, penalty=problem.penalty(own)))
    alone, effect = found
    result = SimpleNamespace(
        soil=alone.fit, soil_alone=alone, candidates=(effect, alone), accepted=(), likeliest=effect
    )
    return problem, result


def test_a_trend_of_the_soil_is_no_scatter():
    problem, result = searched(0.08 * np.arange(RUNS) / (RUNS - 1))
    assert with_likelier_scatter(problem, result) is None


def test_soils_without_order_are_scatter_though_a_drift_takes_a_part_of_it():
    angles = 0.03 * np.asarray([-0.6, 1.4, -1.2, 0.4, -0.2, 1.3, -0.3, 1.6])
    problem, result = searched(angles)
    assert result.likeliest.objective < result.soil_alone.objective  # the drift explains some
    found = with_likelier_scatter(problem, result).covariance.components
    assert found.friction_angle_std == pytest.approx(np.std(angles), rel=0.8)
    assert problem.covariance.components.friction_angle_std == 0.0


def test_effects_that_follow_slip_and_load_are_left_as_they_are():
    problem, result = searched(np.zeros(RUNS), names=("grousers",))
    assert with_likelier_scatter(problem, result) is None


def test_without_a_search_no_scatter_is_looked_for():
    assert (
        with_likelier_scatter(None, SimpleNamespace(soil_alone=None, likeliest=None, accepted=()))
        is None
    )
