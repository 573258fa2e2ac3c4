"""Any regressor of scikit-learn is calibrated and written into a model file."""

import numpy as np
import pytest
from sklearn.ensemble import ExtraTreesRegressor
from sklearn.kernel_ridge import KernelRidge
from trained_by_text import trained_by

from soilml import Estimator
from soilml.errors import InputError
from soilml.regressors import ScikitLearn
from training.export.model_file import export_model
from training.onnx_graph.builder import Graph
from training.onnx_graph.value import Value

TREES = """[[regressor]]
type = "scikit-learn"
estimator = "sklearn.ensemble.ExtraTreesRegressor"
parameters = { n_estimators = 10, min_samples_leaf = 8, random_state = 0 }
"""


def test_the_file_says_what_the_trees_say_with_intervals_that_cover(tmp_path, small_data):
    model = trained_by(TREES, small_data, tmp_path)
    export_model(model, tmp_path / "m.onnx", small_data)
    estimator = Estimator.load(tmp_path / "m.onnx")
    rows = model.data.features[:50]
    found = estimator(slip=rows[:, 0], torque=rows[:, 1] * rows[:, 2], load=rows[:, 2])
    mean, std, _ = model.predict(rows)
    np.testing.assert_allclose(found.mean, mean, rtol=1e-3)
    np.testing.assert_allclose(found.std, std, rtol=1e-3)
    assert (model.scores["estimator"].cover90 > 0.8).all()


def test_a_fitted_forest_knows_where_its_errors_are_larger():
    rng = np.random.default_rng(3)
    x = rng.uniform(-1.0, 1.0, (600, 2))
    y = x[:, 0] + np.where(x[:, 1] > 0.0, 0.5, 0.05) * rng.standard_normal(600)
    forest = ScikitLearn(ExtraTreesRegressor(30, min_samples_leaf=5, random_state=0)).fit(x, y)
    _, std = forest.predict([[0.0, -0.9], [0.0, 0.9]], return_std=True)
    assert std[1] > 2.0 * std[0]


@pytest.mark.parametrize("name", ["os.system", "sklearn.svm.SVC", "sklearn.nothing.Here", "Ridge"])
def test_what_is_no_regressor_of_scikit_learn_is_refused(name):
    with pytest.raises(InputError, match="estimator is"):
        ScikitLearn(name).fit(np.zeros((20, 1)), np.arange(20.0))


def test_what_cannot_be_written_is_refused_by_name():
    x = np.linspace(0.0, 1.0, 30)[:, None]
    ridge = ScikitLearn(KernelRidge()).fit(x, x[:, 0])
    with pytest.raises(InputError, match="KernelRidge cannot be written as ONNX"):
        ridge.add_to_graph(Value(Graph(), "x", np.float64))
