"""Readings of several gears in shared calls of the model, and beside a smooth discrepancy."""

from dataclasses import replace

import numpy as np
import pytest
from gap_sets import case_of
from test_gap_several_gears import LUGS, REST, WHEELS, rows

from soilml import identify
from soilml.config.measurement_noise import Discrepancy
from soilml.errors import InputError
from soilml.fitting.candidate_effects import candidate_effects, with_effect
from soilml.fitting.coordinates import select_free, size_coordinate
from soilml.fitting.covariance import discrepancy_process
from soilml.fitting.predictions import (
    PredictionRequest,
    linearise_many,
    predict_many,
)
from soilml.fitting.readings import stack_readings
from soilml.fitting.usable_readings import usable_readings
from soilml.gap.design.planned_readings import expected_readings, joined_readings
from soilml.gap.design.run_options import run_options
from soilml.gap.evidence.problem import exclude_each_other
from soilml.physics.effects import EFFECTS

WIDTHS = WHEELS.replace("0.12", "0.10", 1)


def request_of(text=WIDTHS + REST):
    """A request with an effect of one gear, one that both share, and soil parameters."""
    case = case_of(text)
    readings = stack_readings(case, rows(case))
    offered = candidate_effects(case, EFFECTS)
    effects = [offered["grousers@lugged"], offered["slip-sinkage"]]
    for effect in effects:
        case = with_effect(case, effect)
    soil = select_free(case, ["friction_angle", "shear_modulus"])
    coordinates = [*soil, *(size_coordinate(effect, None) for effect in effects)]
    return PredictionRequest(case, coordinates, np.asarray([[0.6, 0.4, 0.5, 0.3]]), readings)


def of_one_gear(request, name):
    """The same for one gear, from its own case and rows alone, and the positions of these."""
    case, at = request.case.of_gear(name), request.readings.at
    mine = np.flatnonzero(np.asarray(at.gear) == name)
    own = replace(at, slip=at.slip[mine], load=at.load[mine], gear=None)
    selected, readings = request.readings.of_rows(mine, own)
    acts = [i for i, c in enumerate(request.coordinates) if "@" not in c.path or name in c.path]
    coordinates = [
        replace(c, path=c.path.replace(f"@{name}", ""))
        for c in (request.coordinates[i] for i in acts)
    ]
    return PredictionRequest(case, coordinates, request.x[:, acts], readings), mine, selected, acts


def test_linearisations_of_several_gears_are_those_of_each_gear():
    request = request_of()
    (together,) = linearise_many([request])
    for name in ("smooth", "lugged"):
        own, mine, selected, acts = of_one_gear(request, name)
        (alone,) = linearise_many([own])
        np.testing.assert_array_equal(together.prediction[selected], alone.prediction)
        np.testing.assert_array_equal(together.jacobian[np.ix_(selected, acts)], alone.jacobian)
        np.testing.assert_array_equal(together.log_sinkage[mine], alone.log_sinkage)
        np.testing.assert_array_equal(
            together.log_sinkage_rate[np.ix_(acts, mine)], alone.log_sinkage_rate
        )
        np.testing.assert_array_equal(together.slope[mine], alone.slope)
    smooth = np.asarray(request.readings.at.gear)[request.readings.row] == "smooth"
    assert np.all(together.jacobian[smooth, 2] == 0.0)
    assert np.any(together.jacobian[~smooth, 2] != 0.0)


def test_predictions_near_an_estimate_are_those_of_each_gear():
    request = request_of()
    (base,) = linearise_many([request])
    change = np.asarray([[0.02, 0.0, 0.05, 0.0], [0.0, -0.02, 0.0, 0.05]])
    moved = replace(request, x=request.x + change)
    (exact,) = predict_many([moved])
    (near,) = predict_many([replace(moved, estimate=base.sinkage_at(change))])
    assert np.isfinite(exact).all()
    np.testing.assert_allclose(near, exact, rtol=1e-6)


def test_requests_of_one_and_of_several_gears_share_a_call():
    request = request_of()
    single = of_one_gear(request, "smooth")[0]
    found = predict_many([single, request, single])
    for together, alone in zip(found, (single, request, single), strict=True):
        np.testing.assert_allclose(together, predict_many([alone])[0], rtol=1e-12)


def test_a_value_that_the_model_refuses_for_one_gear_refuses_the_request():
    request = request_of()
    refused = replace(request, x=np.asarray([[0.6, 0.4, 1e6, 0.3]]))  # a height of kilometres
    found = predict_many([request, refused])
    assert isinstance(found[1], InputError) and not isinstance(found[0], InputError)


def test_rows_of_different_gears_are_not_driven_alike():
    request = request_of()
    at, alike = request.readings.at, request.readings.replicates
    gear = np.asarray(at.gear)[request.readings.row]
    assert all(np.unique(gear[alike == group]).size == 1 for group in np.unique(alike))
    nameless = replace(request.readings, at=replace(at, gear=None)).replicates
    assert np.unique(nameless).size == np.unique(alike).size // 2
    # the loads and slips that were set are levels of all gears
    assert request.readings.load_levels.count == 3


def test_each_gear_has_a_discrepancy_of_its_own_with_one_amplitude():
    readings = request_of().readings
    smooth = np.asarray(readings.at.gear)[readings.row] == "smooth"
    process = discrepancy_process(readings, {})
    covariance = process.columns @ process.columns.T
    assert np.all(covariance[np.ix_(smooth, ~smooth)] == 0.0)
    shared = discrepancy_process(replace(readings, at=replace(readings.at, gear=None)), {})
    np.testing.assert_allclose(np.diag(covariance), np.diag(shared.columns @ shared.columns.T))
    np.testing.assert_array_equal(process.usual, shared.usual)
    assert set(process.channel.tolist()) == {0, 1, 2}


def test_identification_beside_a_discrepancy_of_each_gear():
    case = case_of(WIDTHS + REST)
    case = replace(case, discrepancy={"torque_Nm": Discrepancy(share=0.05)})
    table = rows(case)
    readings = usable_readings(case, table)
    process = discrepancy_process(readings, case.discrepancy, Discrepancy())
    assert set(process.channel.tolist()) == {readings.channels.index("torque")}
    smooth = (table["gear"] == "smooth")[readings.row]
    covariance = process.columns @ process.columns.T
    assert np.any(covariance != 0.0) and np.all(covariance[np.ix_(smooth, ~smooth)] == 0.0)
    plain = identify(replace(case, discrepancy={}), table, method="nonlinear")
    assert np.all(identify(case, table, method="nonlinear").std > plain.std)


def test_runs_to_add_name_the_gear_to_drive():
    request = request_of(WIDTHS + LUGS + REST)
    effects = tuple(candidate_effects(request.case, EFFECTS).values())
    options = list(run_options(request.readings, request.case, effects))
    for name in ("smooth", "lugged"):
        mine = [o for o in options if np.all(np.asarray(o.at.gear) == name)]
        assert {"heavier", "lighter"} <= {o.kind for o in mine}
        assert all(o.text.endswith(f"with the gear {name}") for o in mine)
    lugged = next(o for o in options if np.all(np.asarray(o.at.gear) == "lugged"))
    new = expected_readings(lugged.at, request.readings, request.case)
    own = request.case.of_gear("lugged")
    at = replace(new.at, gear=None)
    torque = new.measured[new.channel == new.channels.index("torque")]
    np.testing.assert_array_equal(torque, own.model(own.soil, at).torque)
    joined = joined_readings(request.readings, new)
    assert list(joined.at.gear) == [*request.readings.at.gear, *lugged.at.gear]


@pytest.mark.parametrize(
    ("name", "other", "excluded"),
    [
        ("grousers", "grousers@lugged", True),
        ("grousers@smooth", "grousers@lugged", False),
        ("grousers@lugged", "grousers@lugged", True),
        ("grousers@lugged", "clogging@lugged", False),
        ("shear-softening", "hyperbolic-shear", True),
        ("wheel-flexibility", "flat-rim", True),
        ("wheel-flexibility@lugged", "flat-rim", True),
        ("wheel-flexibility@lugged", "flat-rim@lugged", True),
        ("wheel-flexibility@lugged", "flat-rim@smooth", False),
    ],
)
def test_a_shared_effect_excludes_that_of_one_gear_and_its_family(name, other, excluded):
    offered = candidate_effects(case_of(WIDTHS + REST), EFFECTS)
    pair = offered[name], offered[other]
    assert exclude_each_other(*pair) is exclude_each_other(*reversed(pair)) is excluded


def test_of_the_family_of_an_effect_that_the_case_has_no_other_is_offered():
    case = case_of(WIDTHS + REST)
    case = with_effect(case, EFFECTS["shear-softening"])
    offered = candidate_effects(case, EFFECTS)
    assert "shear-softening" in offered and "hyperbolic-shear" not in offered
    assert "curved-envelope" in offered
