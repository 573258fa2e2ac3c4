"""A soil under another gravity: the schools are the ends of the open law, whose bands hold both."""

from dataclasses import replace

import numpy as np
import pytest
from measured_rows import torque_rows

from soilml import Operating
from soilml.numerics.quantiles import quantile_band
from soilml.physics.soils.gravity_law import GravityChange
from soilml.traction import DrivenVehicle, SoilDraws, performance, pull_report

EARTH, MOON = 9.80665, 1.62
SCHOOLS = ("constant", "proportional")


def test_draws_are_those_of_a_model_with_the_changed_soil(case):
    draws = SoilDraws(("cohesion", "friction_angle"), np.asarray([[0.0, 0.5], [900.0, 0.6]]))
    moved = draws.at_gravity(case, GravityChange(EARTH, MOON, "proportional"))
    found = performance(DrivenVehicle.of_wheel(case, 20.0), moved, np.zeros(0), np.asarray([0.3]))
    soil = replace(case.soil, kphi=case.soil.kphi * MOON / EARTH)
    soil = replace(soil, cohesion=draws.values[:, 0], friction_angle=draws.values[:, 1])
    force = case.model(soil, Operating(slip=0.3, load=20.0))
    np.testing.assert_allclose(found.pull[:, 0], force.drawbar_pull, rtol=1e-9)
    np.testing.assert_allclose(found.deepest[:, 0], force.sinkage, rtol=1e-9)


@pytest.mark.slow
def test_the_open_band_holds_the_medians_of_both_schools(case):
    truth = {"cohesion": 300.0, "friction_angle": 0.6, "shear_modulus": 0.012}
    table = torque_rows(case, truth, [0.1, 0.3, 0.5], [20.0, 60.0, 120.0])
    reports = {
        law: pull_report(
            case, table, loads=[20.0], exact_model=True, gravity=GravityChange(EARTH, MOON, law)
        )
        for law in ("open", *SCHOOLS)
    }
    found = {law: report.by_load[0].posterior for law, report in reports.items()}
    for name in ("largest_pull", "deepest", "steepest_slope"):
        band = quantile_band(getattr(found["open"], name))
        for law in SCHOOLS:
            median = quantile_band(getattr(found[law], name)).middle
            assert (band.lower < median).all() and (median < band.upper).all(), (name, law)
    known = pull_report(case, table, loads=[20.0], exact_model=True)  # loads are the prediction's
    np.testing.assert_array_equal(found["constant"].pull, known.by_load[0].posterior.pull)
