"""The updated case as a file."""

import numpy as np
import pytest
from gap_sets import MODEL, case_of

from soilml.config.write_case import case_as_toml
from soilml.physics.operating_point import Operating

AT = Operating(
    slip=np.asarray([-0.3, 0.1, 0.4, 0.7]), load=np.asarray([30.0, 60.0, 90.0, 150.0]), speed=0.05
)
CHANNELS = ("torque", "drawbar_pull", "sinkage")

EFFECTED = (
    MODEL
    + """\
[[effect]]
name = "slip-sinkage"
n1 = 0.3712345678901234
by_slip = -1.2345678901234
by_load = 0.1
[effect.prior]
n1 = [0.0, 1.0]
[[effect]]
name = "rate"
a = 0.07
[[effect]]
name = "torque-offset"
offset = 1e-05
"""
)


def same_forces(one, other):
    mine, theirs = (case.model(case.soil, AT) for case in (one, other))
    for name in CHANNELS:
        np.testing.assert_allclose(
            getattr(mine, name), getattr(theirs, name), rtol=1e-12, atol=1e-15
        )


@pytest.mark.parametrize(
    "text",
    [
        MODEL,
        EFFECTED,
        MODEL.replace('"wheel"', '"linear-wheel"'),
        MODEL.replace("cohesion = [0.0, 3000.0]", 'kphi = { range = [1e5, 1e7], scale = "log" }'),
        MODEL.replace('"1 %"', "0.05", 1),
    ],
)
def test_a_model_written_and_read_again_predicts_the_same(text):
    case = case_of(text)
    again = case_of(case_as_toml(case, ["a comment", "another one"]))
    same_forces(case, again)
    assert again.prior == case.prior
    assert again.noise == case.noise
    assert again.model == case.model
    assert case_as_toml(again) == case_as_toml(case)
