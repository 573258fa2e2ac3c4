"""Bands cover the truth as often as they say, unless the model lacks what the soil does."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binom

from soilml import SlipSinkage, read_case
from soilml.config.measurement_noise import Noise

sys.path.insert(0, str(Path(__file__).parents[2] / "bench"))

from coverage_study import coverage

pytestmark = pytest.mark.slow

SOILS = 10


@pytest.fixture
def case(model_file):
    return read_case(model_file)


def test_bands_cover_the_truth_as_often_as_they_say(case):
    noisy = replace(case, noise={"torque_Nm": Noise(share=0.2)})  # wide posteriors are quick
    found = coverage(noisy, range(500, 500 + SOILS), (200.0,), count=120)
    for one in found.values():
        for part in (one.pull.rank[:, 2], one.pull.rank[:, 5], one.steepest_slope.rank):
            for low, high in ((0.05, 0.95), (0.25, 0.75)):
                held = int(np.sum((part > low) & (part < high)))
                ends = binom.interval(0.998, SOILS, high - low)
                assert ends[0] <= held <= ends[1]


def test_a_model_without_the_digging_of_the_soil_promises_too_much(case):
    digging = replace(case, model=case.model + SlipSinkage(n1=0.4))
    one = coverage(case, range(2), (60.0,), world=digging, count=120)[60.0]
    assert (one.steepest_slope.error < 0.0).all() and (one.steepest_slope.rank == 0.0).all()
