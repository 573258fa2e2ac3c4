"""Estimates of the sinkage, the equilibrium next to one, and readings to first order."""

from dataclasses import fields, replace

import numpy as np
import pytest

from soilml import EFFECTS, Model, Operating, Status, Wheel, soil
from soilml.physics.contact import Force
from soilml.physics.equilibrium import equilibrium_forces, without_unsolved
from soilml.physics.forces import apply_input_effects, forces_at_sinkage, load_at_sinkage
from soilml.physics.linear_response import linear_response
from soilml.physics.load_case import LoadCase, merge_rows
from soilml.physics.model import flattened, in_chunks_near
from soilml.physics.sinkage_estimate import SinkageEstimate, coarse_estimate, forces_near
from soilml.physics.sinkage_search import equilibrium_near

SAND = soil("wong1989/dry_sand")
WHEEL = Wheel(radius=0.15, width=0.12)
SLIP = np.asarray([0.05, 0.2, 0.4, 0.7])
CHANNELS = ("torque", "drawbar_pull", "sinkage", "entry_angle")


def batch(slip=SLIP, load=60.0, ground=SAND, effects=()):
    at = Operating(slip=np.asarray(slip), load=load * np.ones(len(slip)))
    return flattened(LoadCase(WHEEL, ground, at, effects))[0]


def power(case, sinkage):
    """d ln W / d ln z, by a difference."""
    above, below = (load_at_sinkage(case, sinkage * np.exp(h)) for h in (1e-4, -1e-4))
    return np.log(above / below) / 2e-4


@pytest.mark.parametrize("load", [1.0, 60.0, 300.0])
def test_few_points_give_the_sinkage_to_a_few_thousandths(load):
    case = batch(load=load)
    exact = equilibrium_forces(case).sinkage
    found = coarse_estimate(case)
    assert not found.nearest and found.log_sinkage.dtype == np.float64
    np.testing.assert_allclose(found.log_sinkage, np.log(exact), atol=0.01)
    np.testing.assert_allclose(found.slope, power(case, exact), rtol=0.1)


def test_a_load_far_beyond_the_hub_has_no_estimate_or_one_at_the_hub():
    found = coarse_estimate(batch(load=1e6)).log_sinkage
    assert (np.isnan(found) | (found <= np.log(0.15) + 1e-6)).all()


@pytest.mark.parametrize("off", [-0.3, 1e-3, 0.4])
def test_secant_steps_end_at_the_equilibrium_with_the_slope_of_the_load(off):
    case = batch()
    exact = equilibrium_forces(case)
    slope = power(case, exact.sinkage)
    found, found_slope = forces_near(case, SinkageEstimate(np.log(exact.sinkage) + off, slope))
    assert (found.status == Status.OK).all()
    for name in (*CHANNELS, "load"):
        np.testing.assert_allclose(
            getattr(found, name), getattr(exact, name), rtol=1e-8, err_msg=name
        )
    np.testing.assert_allclose(found_slope, slope, rtol=0.02)


def test_steps_that_leave_the_vicinity_or_the_wheel_are_not_solved():
    case = batch()
    exact = np.log(equilibrium_forces(case).sinkage)
    far = SinkageEstimate(exact - [0.0, 8.0, 0.0, 8.0], np.ones(4))
    found, _ = forces_near(case, far)
    assert found.status.tolist() == [0, Status.NOT_CONVERGED] * 2
    unknown = SinkageEstimate(np.full(4, np.nan), np.ones(4))
    assert (forces_near(case, unknown)[0].status == Status.NOT_CONVERGED).all()
    # a narrower strip of soil would carry the load only below the hub
    heavy = batch(load=1.1 * float(load_at_sinkage(batch(), np.full(4, 0.15)).max()))
    found, _ = forces_near(heavy, SinkageEstimate(np.full(4, np.log(0.149)), np.full(4, 1.3)))
    assert (found.status == Status.NOT_CONVERGED).all()


def test_rows_far_from_the_estimate_are_searched_unless_the_nearest_is_asked_for():
    case = batch()
    exact = equilibrium_forces(case)
    estimate = SinkageEstimate(np.log(exact.sinkage) - [0.0, 8.0, 0.01, 8.0], np.full(4, 1.5))
    found = equilibrium_near(case, estimate)
    np.testing.assert_allclose(found.sinkage, exact.sinkage, rtol=1e-7)
    np.testing.assert_allclose(found.torque, exact.torque, rtol=1e-7)
    nearest = equilibrium_near(case, replace(estimate, nearest=True))
    assert nearest.status.tolist() == [0, Status.NOT_CONVERGED] * 2
    in_rows = in_chunks_near(case, equilibrium_forces, replace(estimate, nearest=True))
    np.testing.assert_array_equal(np.isnan(in_rows.torque), [False, True] * 2)
    np.testing.assert_allclose(
        in_chunks_near(case, equilibrium_forces, None).torque, exact.torque, rtol=1e-12
    )


def test_rows_that_were_solved_apart_are_put_back_in_order():
    def numbered(start, count):
        return Force(**{f.name: start + np.arange(count) for f in fields(Force)})

    keep = np.asarray([False, True, True, False, True])
    merged = merge_rows(numbered(0, 5), keep, numbered(10, 2))
    for field in fields(Force):
        assert getattr(merged, field.name).tolist() == [10, 1, 2, 11, 4]


def test_rows_without_equilibrium_are_blank_but_for_load_and_status():
    one = np.ones(2)
    force = without_unsolved(Force(one, one, one, one, one, np.asarray([0, Status.TOO_HEAVY])))
    for name in CHANNELS:
        np.testing.assert_array_equal(getattr(force, name), [1.0, np.nan])
    assert force.load.tolist() == [1.0, 1.0]


EFFECT_LISTS = [
    (),
    (EFFECTS["load-gain"](gain=0.05), EFFECTS["torque-offset"](offset=0.2)),
    (EFFECTS["load-transfer"](ratio=0.1), EFFECTS["slip-sinkage"](n1=0.3)),
]


@pytest.mark.parametrize("effects", EFFECT_LISTS, ids=["plain", "sensors", "rig"])
def test_readings_of_slightly_changed_rows_are_right_to_first_order(effects):
    """Row 0 and row 3 are base rows; the others change slip, load, friction, stiffness by `h`."""
    base = np.asarray([0, 0, 0, 3, 3, 3])
    direction = np.asarray([0.0, 1.0, -1.0, 0.0, 1.0, 1.0])
    model = Model(WHEEL, effects)

    def rows(h):
        change = h * direction
        ground = replace(
            SAND,
            friction_angle=SAND.friction_angle + change * [0, 1, 0, 0, 1, 0],
            kphi=SAND.kphi * (1.0 + change * [0, 0, 1, 0, 0, 1]),
        )
        slip = np.asarray([0.2, 0.2, 0.2, 0.5, 0.5, 0.5]) + change * [0, 0, 1, 0, 1, 0]
        return ground, Operating(slip=slip, load=60.0 * (1.0 + change * [0, 1, 1, 0, 0, 2]))

    def errors(h):
        ground, at = rows(h)
        case, _ = flattened(LoadCase(WHEEL, ground, at, effects))
        found, exact = linear_response(case, base), model(ground, at)
        assert not found.force.status.any()
        off = [getattr(found.force, n) / getattr(exact, n) - 1.0 for n in CHANNELS]
        true = apply_input_effects(case)
        z = Model(WHEEL, tuple(e for e in effects if "offset" not in e.name))(ground, at).sinkage
        off.append(found.sinkage.log_sinkage - np.log(z))
        slope = (
            np.log(
                forces_at_sinkage(true, z * np.exp(1e-4)).load
                / forces_at_sinkage(true, z * np.exp(-1e-4)).load
            )
            / 2e-4
        )
        np.testing.assert_allclose(found.sinkage.slope, slope[base], rtol=3e-3 + 3 * h)
        return np.abs(off)

    small, smaller = errors(1e-2), errors(1e-3)
    np.testing.assert_allclose(smaller[:, base == np.arange(6)], 0.0, atol=1e-9)
    assert small.max() < 0.02
    assert (smaller < np.maximum(0.02 * small, 3e-8)).all()  # of second order: a hundredth


def test_rows_of_a_base_row_without_equilibrium_are_blank():
    case = batch(slip=[0.2, 0.2, 0.5, 0.5], load=np.asarray([1e6, 60.0, 60.0, 60.0]))
    found = linear_response(case, np.asarray([0, 0, 2, 2])).force
    assert found.status[:2].all() and not found.status[2:].any()
    assert np.isnan(found.torque).tolist() == [True, True, False, False]


@pytest.mark.parametrize("off", [0.0, 0.01, -0.1])
def test_readings_of_first_order_start_from_an_estimate_of_the_base_rows(off):
    """The search is rough, and what it leaves is corrected to the second order."""
    case = batch(slip=[0.2, 0.21, 0.5, 0.51])
    base = np.asarray([0, 0, 2, 2])
    alone = linear_response(case, base)
    near = alone.sinkage.log_sinkage[[0, 2]] + off
    estimate = SinkageEstimate(near, 0.9 * alone.sinkage.slope[[0, 2]])
    again = linear_response(case, base, estimate)
    for name in (*CHANNELS, "load"):
        np.testing.assert_allclose(
            getattr(again.force, name), getattr(alone.force, name), rtol=1e-8
        )
