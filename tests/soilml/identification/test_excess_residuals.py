"""Where residuals are said to exceed the declared noise."""

from dataclasses import replace

import numpy as np
import pytest
from remarked import remarked
from test_identification import TRUTH, measured

from soilml import identify, read_case
from soilml.config.measurement_noise import Noise
from soilml.io.table import Table


@pytest.fixture
def case(model_file):
    return read_case(model_file)


@pytest.mark.parametrize(("squares", "excess"), [(2.4, False), (2.65, True)])
def test_residuals_exceed_the_noise_that_noise_alone_exceeds_once_in_a_thousand_sets(
    case, squares, excess
):
    """Of 15 degrees of freedom: from 37.7 / 15 = 2.51 times the variance, by tables of chi2."""
    known = replace(case, noise={"torque_Nm": Noise(constant=0.05)})
    slip, load = np.tile(np.linspace(0.1, 0.6, 6), 3), np.repeat([40.0, 70.0, 110.0], 6)
    exact = measured(case, TRUTH, slip, load)
    pattern = 0.05 * np.random.default_rng(5).standard_normal(18)
    size = 1.0
    for _ in range(3):  # the misfit grows nearly by the square of the pattern's size
        table = Table({**exact.columns, "torque_Nm": exact["torque_Nm"] + size * pattern})
        fit = identify(known, table, method="nonlinear")
        size *= np.sqrt(squares / fit.misfit)
    assert fit.misfit == pytest.approx(squares, rel=1e-2)
    assert remarked(fit.warnings, "times the declared noise") == excess
