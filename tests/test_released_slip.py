"""Slip by the released linear files: fused and repeated, on data that they were not trained on."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from datagen.recipe import Block, read_recipe
from datagen.simulation import simulate_pieces
from soilml import Estimator
from soilml.onboard.multi_sensor import fuse_estimates
from soilml.quantities import column

ROOT = Path(__file__).parents[1]
SENSORS = ("torque", "vibration")
SOILS = {"unknown": ("wheel_leg", ""), "known": ("wheel_leg_known", "_known")}
#: In the regime of the paper's tests torque tells hardly anything, which is tested on its own.
FILES = SOILS | {"paper": ("wheel_leg_paper", "_paper")}


def files(soil):
    folder = ROOT / "exported"
    return [Estimator.load(folder / f"slip_{s}{FILES[soil][1]}.onnx") for s in SENSORS]


def rows(soil, count, block):
    """Columns of answered rows of a seed that no file was trained on."""
    recipe = replace(read_recipe(FILES[soil][0]), blocks=(block,)).sized(count, seed=60606)
    parts = list(simulate_pieces(recipe))
    names = ("slip", "load_N", *(column(s) for s in SENSORS), "status")
    columns = {k: np.concatenate([p[k] for p in parts]) for k in names}
    answered = columns.pop("status") == "ok"
    return {k: v[answered] for k, v in columns.items()}


def estimates(soil, columns):
    return [f(**{n: columns[column(n)] for n in f.inputs}) for f in files(soil)]


def error_and_cover(found, slip):
    inside = (found.low[:, 0] <= slip) & (slip <= found.high[:, 0])
    return np.sqrt(np.mean((found.mean[:, 0] - slip) ** 2)), inside.mean()


@pytest.mark.parametrize("soil", SOILS)
def test_the_files_of_both_sensors_have_the_same_held_out_rows(soil):
    one, other = (f.errors for f in files(soil))
    assert len(np.intersect1d(one.rows, other.rows)) > 1900


@pytest.mark.slow
@pytest.mark.parametrize("soil", SOILS)
def test_fused_slip_is_better_than_either_sensors_and_its_intervals_hold(soil):
    columns = rows(soil, 8000, Block(1, 1.0))
    each = estimates(soil, columns)
    fused = fuse_estimates(each)
    error, held = error_and_cover(fused.estimate, columns["slip"])
    assert error < 0.97 * min(error_and_cover(e, columns["slip"])[0] for e in each)
    assert 0.88 <= held <= 0.92


@pytest.mark.slow
def test_in_the_regime_of_the_paper_vibration_alone_tells_slip_and_fusion_keeps_it():
    columns = rows("paper", 8000, Block(1, 1.0))
    each = estimates("paper", columns)
    prior = each[0].prior.std[0]
    torque, vibration = (error_and_cover(e, columns["slip"])[0] / prior for e in each)
    error, held = error_and_cover(fuse_estimates(each).estimate, columns["slip"])
    assert torque > 0.9 and vibration < 0.6
    assert error < 1.01 * vibration * prior
    assert 0.87 <= held <= 0.93


def test_a_missing_sensor_leaves_the_other_ones_estimate():
    by_torque, by_vibration = files("unknown")
    torque = by_torque(torque=[2.0, 2.5], load=25.0)
    fused = fuse_estimates([torque, by_vibration.prior_estimate(2)])
    np.testing.assert_array_equal(fused.estimate.mean, torque.mean)
    np.testing.assert_array_equal(fused.estimate.low, torque.low)
    assert fused.used.tolist() == [[True, True], [False, False]]
