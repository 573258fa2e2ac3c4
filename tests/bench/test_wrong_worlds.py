"""Worlds of the benches: each gives readings."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "bench"))

import faults_on_board
from wrong_worlds import LAW_WORLDS, WORLDS, simulate, unlisted_worlds

EVERY = (*WORLDS, *LAW_WORLDS, *unlisted_worlds(), *faults_on_board.WORLDS)


@pytest.mark.parametrize("world", EVERY, ids=lambda world: world.name)
def test_a_world_gives_readings_of_each_channel(world):
    drives = simulate(world, sets=2, rows=3, seed=0)
    for name in ("slip", "load", "torque", "sinkage", "drawbar_pull"):
        assert drives.readings[name].shape == (2, 3)
        assert np.isfinite(drives.readings[name]).all()
