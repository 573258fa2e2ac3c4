"""The soil under a wheel-leg, learned from simulated strides."""

import pytest
from trained_by_text import trained_by

from datagen.generate import generate
from datagen.recipe import read_recipe

SPEC = """\
features = ["slip", "load", "torque/load", "vibration", "sinkage"]
targets = ["friction_angle", "normal_stiffness"]
"""
READ = ('"slip", "load", "torque/load"', '"slip", "load", "vibration"', '"load", "sinkage"')


@pytest.mark.slow
def test_sinkage_tells_stiffness_and_torque_and_vibration_tell_friction(tmp_path):
    """Comin and Saaj 2017, section IV-B: sinkage for load bearing, slip models for shear."""
    generate(read_recipe("wheel_leg").sized(4000), tmp_path / "strides.parquet")
    machine = '[[regressor]]\ntype = "fixed-size-lssvm"\ncentres = 30\nfeatures = [{}]\n'
    spec = SPEC + "".join(machine.format(names) for names in READ)
    trained = trained_by(spec, tmp_path / "strides.parquet", tmp_path)
    names = [*(m.regressor.name for m in trained.members), "estimator"]
    friction, stiffness = zip(*(trained.scores[n].relative for n in names), strict=True)
    assert max(friction[:2]) < 0.85 < 0.95 < friction[2]
    assert stiffness[2] < 0.4 < 0.8 < min(stiffness[:2])
    assert friction[3] < min(friction[:3]) and stiffness[3] < min(stiffness[:2])
