"""Scales of the model's errors: of a spec, of a file, and in its answers."""

from dataclasses import replace

import numpy as np
import pytest

from training.set_posterior.error_scales import USUAL_SCALES, ErrorScale, ErrorScales
from training.set_posterior.validation import graph_outputs, posterior_session


@pytest.mark.slow
def test_a_file_answers_by_its_own_scales(wheel_posterior):
    one = ErrorScales((ErrorScale(1.0, bearing=1.0, channels=1.0, laws=1.0),))
    checked = ErrorScales(
        (
            ErrorScale(0.9, bearing=0.1, channels=0.1, laws=0.1),
            ErrorScale(0.1, bearing=1.0, channels=1.0, laws=1.0),
        )
    )
    response, sets = wheel_posterior.response, wheel_posterior.family.sets(4, 16, 9)
    stds, told = {}, []
    for name, scales in {"one": one, "checked": checked, "usual": USUAL_SCALES}.items():
        session = posterior_session(replace(wheel_posterior, scales=scales))
        found = [graph_outputs(session, response, sets, k, {"model_error": -1.0}) for k in range(4)]
        stds[name] = np.stack([one["set_std"] for one in found])
        told.append(graph_outputs(session, response, sets, 0, {"model_error": 1.0})["set_std"])
    assert (stds["checked"] < stds["one"]).all()
    assert stds["one"][0] == pytest.approx(told[0], rel=1e-3)  # of the size that it is told
    for std in told[1:]:
        assert std == pytest.approx(told[0], rel=1e-3)
