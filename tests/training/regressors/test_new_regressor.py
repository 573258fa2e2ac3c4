"""A new regressor needs its class and a line of the catalogue: card and export follow."""

import numpy as np
from trained_by_text import trained_by

from soilml import Estimator
from training import spec as specs
from training.export.model_card import model_card
from training.export.model_file import export_model
from training.regressors.gaussian_regressor import GaussianRegressor


class MeanRegressor(GaussianRegressor):
    """The mean and variance of the training targets, whatever the inputs."""

    type_name = "mean"

    def _fit_standardised(self, x, z, groups, progress):
        self.zeros_ = np.zeros((x.shape[1], z.shape[1]))

    def _standardised_outputs(self, x):
        zero = x @ self.zeros_
        return zero, zero


def test_a_new_regressor_is_trained_exported_and_described(tmp_path, small_data, monkeypatch):
    monkeypatch.setitem(specs.REGRESSORS, "mean", MeanRegressor)
    trained = trained_by('[[regressor]]\ntype = "mean"\n', small_data, tmp_path)
    metadata = export_model(trained, tmp_path / "m.onnx", small_data)
    assert "Regressors: mean." in model_card(trained, metadata, "m")
    estimator = Estimator.load(tmp_path / "m.onnx")
    estimate = estimator(slip=0.3, torque=3.0, load=60.0)
    np.testing.assert_allclose(estimate.mean, estimator.prior.mean, rtol=1e-6)
    np.testing.assert_allclose(estimate.std, estimator.prior.std, rtol=0.05)
