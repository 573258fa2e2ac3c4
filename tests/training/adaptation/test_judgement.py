"""Predictions of later rows by files that know the soil exactly, on a right and a wrong model."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from conftest import THREE_CHANNEL_MODEL

from soilml import SlipSinkage, read_case, simulate
from soilml.onboard.estimate import Estimate
from soilml.onboard.gaussian_product import PriorSummary
from soilml.quantities import SHEAR
from training.adaptation.judgement import BoardCandidate, judge


@dataclass
class KnownSoil:
    """Stands for a model file: it answers with one soil, and remembers what it was given."""

    mean: np.ndarray
    std: np.ndarray
    inputs = ("slip", "torque", "load")
    sets = None

    def run(self, **readings):
        self.given = readings
        lower, upper = np.zeros(3), np.asarray([3000.0, 0.8, 0.04])
        prior = PriorSummary(0.5 * (lower + upper), 0.3 * (upper - lower), lower, upper)
        true = np.bool_(True)
        covariance = np.diag(self.std**2)
        units = ("Pa", "rad", "m")
        return Estimate.gaussian(
            SHEAR, units, prior, self.mean, covariance, self.std, true, np.full(3, 1.6)
        )


@pytest.fixture
def case(tmp_path):
    path = tmp_path / "model.toml"
    path.write_text(THREE_CHANNEL_MODEL)
    return read_case(path)


@pytest.fixture
def world(case):
    """The case with slip-sinkage, and two runs of it."""
    true = replace(case, model=replace(case.model, effects=(SlipSinkage(n1=0.4),)))
    slip, load = np.tile(np.linspace(0.1, 0.6, 12), 2), np.repeat([50.0, 90.0], 12)
    return true, simulate(true, slip, load, run=np.repeat(["a", "b"], 12), seed=1)


def soil_of(case):
    return np.asarray([float(getattr(case.soil, name)) for name in SHEAR])


def candidate(case, std=1e-9):
    return BoardCandidate(KnownSoil(soil_of(case), np.full(3, std) * soil_of(case)), case)


def test_the_right_model_predicts_to_the_noise_and_the_wrong_one_does_not(case, world):
    true, table = world
    found = judge(table, candidate(case), candidate(true))
    assert [run.first_rows for run in found.runs] == [8, 8]
    assert found.channels == ("torque_Nm", "drawbar_pull_N", "sinkage_m")
    assert found.ratio < 0.2
    for before, after in found.figures().values():
        assert after.error < 0.03 and after.error < before.error
        assert after.log_score > before.log_score
    reverse = judge(table, candidate(true), candidate(case))
    assert reverse.ratio == pytest.approx(1.0 / found.ratio)
