"""Estimates of the sinkage, the equilibrium next to one, and readings to first order."""

from dataclasses import replace

import numpy as np
import pytest

from soilml import EFFECTS, Model, Operating, Wheel, soil
from soilml.physics.forces import apply_input_effects, forces_at_sinkage
from soilml.physics.linear_response import linear_response
from soilml.physics.load_case import LoadCase
from soilml.physics.model import flattened

SAND = soil("wong1989/dry_sand")
WHEEL = Wheel(radius=0.15, width=0.12)
CHANNELS = ("torque", "drawbar_pull", "sinkage", "entry_angle")


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
