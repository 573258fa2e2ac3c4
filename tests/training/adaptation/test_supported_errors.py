"""Sizes of a model's errors from runs that were kept back: of a right model, and of a wrong one."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import THREE_CHANNEL_MODEL

from soilml import ExitAngle, SlipSinkage, read_case, simulate
from soilml.io.table import Table
from training.adaptation.supported_errors import supported_errors
from training.set_posterior.error_scales import USUAL_SCALES

pytestmark = pytest.mark.slow


@pytest.fixture
def case(tmp_path):
    (tmp_path / "model.toml").write_text(THREE_CHANNEL_MODEL)
    return read_case(tmp_path / "model.toml")


def rows_of(case, *effects, loads=(50.0, 90.0)):
    true = replace(case, model=replace(case.model, effects=effects))
    slip = np.tile(np.linspace(0.08, 0.6, 14), len(loads))
    names = np.repeat([f"r{i}" for i in range(len(loads))], 14)
    return simulate(true, slip, np.repeat(loads, 14), run=names, seed=2)


def supported_scales(case, kept_back, whole):
    return supported_errors(case, kept_back, whole).scales


def whole_of(kept_back, case, *effects):
    more = rows_of(case, *effects, loads=(40.0, 70.0, 110.0))
    shared = kept_back.columns.keys() & more.columns.keys()
    joined = {k: np.concatenate([kept_back[k], more[k]]) for k in shared}
    joined["run"] = np.concatenate([kept_back["run"], np.char.add("m", more["run"])])
    return Table(joined, "all")


def test_rows_that_the_model_predicts_support_small_errors(case):
    kept_back = rows_of(case)
    scales = supported_scales(case, kept_back, whole_of(kept_back, case))
    assert scales.probabilities[0] > 0.7
    assert scales.probabilities.sum() == pytest.approx(1.0)
    assert (scales.sizes[1:] == USUAL_SCALES.sizes).all()


@pytest.mark.parametrize("effect", [SlipSinkage(n1=0.3), ExitAngle(kappa=0.3)])
def test_rows_that_it_does_not_predict_support_the_usual_ones(case, effect):
    kept_back = rows_of(case, effect)
    scales = supported_scales(case, kept_back, whole_of(kept_back, case, effect))
    assert scales.probabilities[0] < 0.05
