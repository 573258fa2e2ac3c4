"""The fault detector: rows against the exact model, beside the answer with errors of the model."""

from pathlib import Path

import numpy as np
import pytest

from datagen.recipe import read_recipe
from soilml import Estimator, SoilTracker, simulate
from soilml.onboard.set_contract import SENSOR_ERROR_INPUTS
from soilml.quantities import SHEAR

EXPORTED = Path(__file__).parents[3] / "exported"
CHANNELS = ("slip", "load", "torque", "sinkage", "drawbar_pull")
FAULTS = {
    "none": lambda rows: rows,
    "torque in lbf ft": lambda rows: rows | {"torque": 1.356 * rows["torque"]},
    "torque halved": lambda rows: rows | {"torque": 0.5 * rows["torque"]},
}


def sets_of_rows(count, seed, fault=FAULTS["none"], rows=16):
    """Rows of all channels on soils of the prior, with the noise of the recipe."""
    case, rng = read_recipe("wheel").case, np.random.default_rng(seed)
    for number in range(count):
        soil = {name: float(case.prior[name].at(rng.random(1))[0]) for name in SHEAR}
        slip, load = rng.uniform(0.08, 0.5, rows), rng.uniform(40.0, 110.0, rows)
        table = simulate(case.with_values(soil), slip, load, seed=[seed, number])
        names = ("torque_Nm", "sinkage_m", "drawbar_pull_N")
        read = dict(zip(CHANNELS[2:], (np.asarray(table[n]) for n in names), strict=True))
        yield fault({"slip": slip, "load": load} | read)


@pytest.fixture(scope="module", params=["wheel", "wheel_small"])
def estimator(request):
    return Estimator.load(EXPORTED / f"{request.param}.onnx")


@pytest.mark.parametrize("name", ["torque in lbf ft", "torque halved"])
def test_faults_that_the_answer_explains_are_detected(estimator, name):
    found = [estimator.run(**rows) for rows in sets_of_rows(20, 5, FAULTS[name])]
    assert all(e.disagrees for e in found)
    assert np.mean([e.in_range for e in found]) > 0.4  # errors of the model explain them


def test_few_sound_sets_are_flagged(estimator):
    found = [estimator.run(**rows) for rows in sets_of_rows(200, 6)]
    assert sum(bool(e.disagrees) for e in found) <= 6


def test_it_is_the_misfit_of_the_same_rows_with_an_exact_model(estimator):
    exact = estimator.on(model_error=0.0)
    for rows in sets_of_rows(5, 7, FAULTS["torque in lbf ft"]):
        found, memory = estimator.run(**rows), estimator.start()
        expected = exact.run(**rows)
        assert float(found.exact_misfit) == pytest.approx(float(expected.misfit), rel=0.02)
        assert float(expected.exact_misfit) == float(expected.misfit)
        for first in range(0, 16, 4):
            part = {name: values[first : first + 4] for name, values in rows.items()}
            stepped, memory = estimator.step(memory, **part)
        assert float(stepped.exact_misfit) == pytest.approx(float(expected.misfit), rel=0.05)


def test_sensors_that_are_declared_exact_are_checked_as_exact(estimator):
    declared = estimator.on(**dict.fromkeys(SENSOR_ERROR_INPUTS, 0.0))
    exact = declared.on(model_error=0.0)
    shifted = [rows | {"slip": rows["slip"] + 0.01} for rows in sets_of_rows(3, 8)]
    for rows in shifted:
        found, expected = declared.run(**rows), exact.run(**rows)
        assert float(found.exact_misfit) == pytest.approx(float(expected.misfit), rel=0.02)
        assert found.exact_misfit > estimator.run(**rows).exact_misfit


def test_rows_that_tell_nothing_are_not_flagged(estimator):
    outside = estimator.run(slip=[0.9, 0.95], torque=[1.0, 1.1], load=[60.0, 60.0])
    assert not outside.disagrees
    single = estimator(slip=0.3, torque=2.1, load=60.0)
    assert not single.disagrees and np.isnan(single.exact_misfit)


def test_a_tracker_says_it_of_the_rows_that_it_remembers():
    estimator = Estimator.load(EXPORTED / "wheel.onnx")
    for fault, expected in (("none", False), ("torque halved", True)):
        (rows,) = sets_of_rows(1, 9, FAULTS[fault])
        tracker = SoilTracker(estimator)
        for i in range(16):
            state = tracker.read(**{name: float(values[i]) for name, values in rows.items()})
        assert state.rows_remembered > 10
        assert bool(state.estimate.disagrees) == expected
