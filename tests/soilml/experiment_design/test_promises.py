"""What a file promises of the advised reading is what it then leaves."""

from pathlib import Path

import numpy as np
import pytest

from soilml import Estimator, Operating, read_case
from soilml.experiment_design.design import SLIPS
from soilml.experiment_design.next_rows import advice_of_file
from soilml.fitting.coordinates import select_free
from soilml.identification.model_error_inputs import with_exact_model

pytestmark = pytest.mark.long

MODEL = Path(__file__).parents[3] / "examples" / "wheel" / "model.toml"
LOADS = (30.0, 42.0, 60.0, 85.0, 120.0)


def readings(case, truth, points, normal, shared):
    """By name, as they are read: with an offset of slip and gains of load and torque."""
    offset, load_gain, torque_gain = shared
    slip, load = np.asarray(points).T
    true = case.with_values(truth)
    at = Operating(slip=slip - offset, load=load / load_gain)
    torque = np.asarray(true.model(true.soil, at).torque)
    torque = torque + case.noise["torque_Nm"].std(torque) * normal
    return {"slip": slip, "load": load, "torque": torque_gain * torque}


@pytest.mark.parametrize("mode", [lambda file: file, with_exact_model], ids=["default", "exact"])
def test_a_file_leaves_what_it_promised_in_the_mode_in_which_it_answers(mode):
    file, case, rng = mode(Estimator.load("wheel")), read_case(MODEL), np.random.default_rng(5)
    free, usual, promised, left = select_free(case, None), file.sets.common_errors, [], []
    for _ in range(16):
        truth = {f.path: float(f.prior.at(rng.random())) for f in free}
        points = [(float(rng.choice(SLIPS)), float(rng.choice(LOADS))) for _ in range(2)]
        sizes = (usual[name] for name in ("slip_bias", "load_gain", "torque_gain"))
        offset, of_load, of_torque = (size * float(rng.standard_normal()) for size in sizes)
        shared, normal = (offset, 1.0 + of_load, 1.0 + of_torque), rng.standard_normal(3)
        driven = readings(case, truth, points, normal[:2], shared)
        found = file.run(**driven)
        if found.in_range:
            best = advice_of_file(file, found.mean, found.covariance, driven).best()
            points.append((best.candidate.slip, best.candidate.load))
            after = file.run(**readings(case, truth, points, normal, shared))
            promised.append(best.remaining_fraction)
            left.append(after.std / file.prior.std)
    assert len(left) > 8
    # over 120 soils the ratio is 1.02 to 1.07 by default and .96 to .99 with the exact model; that
    # of 60 soils differs from seed to seed by up to .06, that of 16 by twice as much
    promised, left = (np.sqrt(np.mean(np.square(w), axis=0)) for w in (promised, left))
    np.testing.assert_allclose(promised, left, rtol=0.2)
