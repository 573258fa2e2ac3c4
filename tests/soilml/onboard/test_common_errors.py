"""Errors that all rows of a set share, of the sensors and of the model."""

import json

import numpy as np
import pytest
from conftest import simulated_run

from soilml.errors import InputError
from soilml.onboard.set_contract import COMMON_ERROR_INPUTS, INFERRED, MODEL_ERROR_INPUT
from soilml.onboard.set_posterior import SetPosterior
from soilml.physics.operating_point import Operating

#: Sensors without errors that all readings share.
EXACT = dict.fromkeys(COMMON_ERROR_INPUTS, 0.0)


@pytest.mark.parametrize(
    ("name", "size"), [("slip_bias", 0.05), ("load_gain", 0.1), ("torque_gain", 0.1)]
)
def test_a_common_error_increases_the_covariance(wheel_sets, wheel_posterior, name, size):
    run, _ = simulated_run(wheel_posterior, 16)
    exact = wheel_sets.on(**EXACT)
    found = [exact.on(**{name: std}).run(**run).covariance for std in (0.0, size)]
    assert np.linalg.det(found[1]) > 1.3 * np.linalg.det(found[0])


@pytest.mark.parametrize(("name", "share"), [("slip", 0.1), ("load", 0.05)])
def test_noise_of_slip_and_load_increases_the_covariance(wheel_sets, wheel_posterior, name, share):
    run, _ = simulated_run(wheel_posterior, 16)
    exact = wheel_sets.on(**EXACT)
    noisy = exact.run(**run, **{f"{name}_std": share * run[name]})
    assert np.linalg.det(noisy.covariance) > 1.3 * np.linalg.det(exact.run(**run).covariance)
    declared = exact.on(noise={name: (0.0, share)}).run(**run)
    assert declared.mean == pytest.approx(noisy.mean, rel=1e-5)
    assert declared.std == pytest.approx(noisy.std, rel=1e-5)


def wrong_runs(posterior, bearing):
    """Runs (rows,) on soils of the prior that bear less or more than the model's, and the soils."""
    family, rng = posterior.family, np.random.default_rng(4)
    case = family.recipe.case
    for _ in range(120):
        x = np.asarray([axis.quantile(rng.random()) for axis in family.axes])
        truth = [float(axis.value(v)) for axis, v in zip(family.axes, x, strict=True)]
        names = [axis.name for axis in family.axes]
        values = {name: bearing * getattr(case.soil, name) for name in ("kc", "kphi")}
        soil = case.with_values(values | dict(zip(names, truth, strict=True))).soil
        slip, load = rng.uniform(0.06, 0.58, 16), rng.choice([40.0, 70.0, 100.0], 16)
        torque = case.model(soil, Operating(slip=slip, load=load)).torque
        noisy = torque * (1.0 + 0.02 * rng.standard_normal(16))
        yield {"slip": slip, "load": load, "torque": noisy}, np.asarray(truth)


def test_intervals_hold_where_the_bearing_is_another(wheel_sets, wheel_posterior):
    held = {0.0: [], 1.0: []}
    for run, truth in wrong_runs(wheel_posterior, 0.55):
        for size, own in held.items():
            found = wheel_sets.on(model_error=size).run(**run)
            own.append((truth >= found.low) & (truth <= found.high))
    right, usual = (np.mean(own, axis=0) for own in held.values())
    assert right[2] < 0.4 and right.min() < usual.min()
    assert usual.min() > 0.7


def test_the_size_of_the_errors_of_the_model_is_inferred_unless_told(wheel_sets, wheel_posterior):
    run, _ = simulated_run(wheel_posterior, 16)
    assert wheel_sets.sets.common_errors[MODEL_ERROR_INPUT] == INFERRED
    told = wheel_sets.on(model_error=INFERRED)
    assert np.array_equal(wheel_sets.run(**run).mean, told.run(**run).mean)
    assert (wheel_sets.run(**run).std > wheel_sets.on(model_error=0.0).run(**run).std).all()


def test_a_stream_has_the_errors_of_its_model(wheel_sets, wheel_posterior):
    run, _ = simulated_run(wheel_posterior, 24)
    usual = wheel_sets.on(model_error=1.0)
    memory = usual.start()
    for first in range(0, 24, 4):
        part = {name: values[first : first + 4] for name, values in run.items()}
        found, memory = usual.step(memory, **part)
    together = usual.run(**run)
    assert np.abs(found.mean - together.mean).max() < together.std.max()
    assert found.std == pytest.approx(together.std, rel=0.25)
    with pytest.raises(InputError, match="this memory is of"):
        wheel_sets.step(memory, **run)


@pytest.mark.parametrize(
    ("lacking", "columns"),
    [({"model_errors"}, 6), ({"errors", "model_errors", "least_share_in_range", "misfit"}, 1)],
)
def test_files_of_earlier_interfaces_know_fewer_errors(wheel_sets, lacking, columns):
    metadata = json.loads(wheel_sets.metadata["set"])
    metadata["errors"].pop("model_error")
    former = SetPosterior.of({k: v for k, v in metadata.items() if k not in lacking})
    assert former.columns == former.terms + columns
    with pytest.raises(InputError, match="of an earlier version takes it as zero: train it again"):
        former.with_context({"model_error": 1.0}, {})
