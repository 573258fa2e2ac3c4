"""Estimates of a model file where a narrower prior is known."""

import csv
from dataclasses import replace

import numpy as np
import pytest

from datagen.recipe import read_recipe
from soilml import Estimator, Operating, Table, identify
from soilml.cli import main
from soilml.io.text_tables import csv_text
from soilml.numerics.prior import Prior
from soilml.onboard.estimate import Reason
from soilml.quantities import SHEAR

EXACT = {"slip_bias": 0.0, "load_gain": 0.0, "torque_gain": 0.0}


@pytest.fixture(scope="module")
def rover():
    return Estimator.load("exported/wheel.onnx").on(**EXACT)


def readings(rng, truth, rows):
    case = read_recipe("wheel").case
    sound = case.with_values(dict(zip(SHEAR, truth, strict=True)))
    slip, load = rng.uniform(0.05, 0.6, rows), rng.uniform(30.0, 120.0, rows)
    torque = sound.model(sound.soil, Operating(slip=slip, load=load)).torque
    return {"slip": slip, "load": load, "torque": torque * rng.normal(1.0, 0.02, rows)}


@pytest.mark.slow
def test_it_is_nearly_the_posterior_with_that_prior(rover):
    """Errors beside those of the exact posterior, over random soils and boxes."""
    rng, case = np.random.default_rng(3), read_recipe("wheel").case
    scale = np.asarray([case.prior[name].std for name in SHEAR])
    errors, exact, wide, held = [], [], [], []
    for _ in range(12):
        truth = np.asarray([case.prior[name].at(rng.random()) for name in SHEAR])
        box = {}
        for name, value in zip(SHEAR, truth, strict=True):
            own = case.prior[name]
            width = (own.upper - own.lower) * rng.uniform(0.1, 0.5)
            low = float(np.clip(value - width * rng.random(), own.lower, own.upper - width))
            box[name] = (low, low + width)
        rows = readings(rng, truth, 16)
        before = rover.on(model_error=0.0).run(**rows)
        found = before.within(**box)
        table = Table({"slip": rows["slip"], "load_N": rows["load"], "torque_Nm": rows["torque"]})
        narrow = replace(case, prior={name: Prior(*ends) for name, ends in box.items()})
        best = identify(narrow, table, SHEAR, "posterior")
        errors.append((found.mean - truth) / scale)
        exact.append((best.values - truth) / scale)
        wide.append((before.mean - truth) / scale)
        held.append((found.low <= truth) & (truth <= found.high))
        assert (found.low >= found.prior.lower).all() and (found.high <= found.prior.upper).all()
    rms = [np.sqrt(np.mean(np.square(e))) for e in (errors, exact, wide)]
    assert rms[0] < 1.2 * rms[1]
    assert rms[0] < rms[2]
    assert 0.75 <= np.mean(held) <= 1.0


def test_readings_that_contradict_it_are_flagged(rover):
    wide = rover.run(**readings(np.random.default_rng(4), [2500.0, 0.75, 0.01], 24))
    found = wide.within(friction_angle=(0.44, 0.46))
    assert not found.in_range and found.reason == Reason.INCONSISTENT
    assert found["friction_angle"][0] == pytest.approx(0.45)
    assert found.abstains.all()


def test_quantities_contradict_a_box_together(rover):
    wide = rover.on(model_error=0.0).run(
        **readings(np.random.default_rng(4), [900.0, 0.6, 0.01], 24)
    )
    # cohesion and friction angle stand for each other: both cannot be above their means
    ends = wide.mean + np.asarray([[1.5], [3.5]]) * wide.std
    both = {name: tuple(ends[:, i]) for i, name in enumerate(SHEAR[:2])}
    assert not wide.within(**both).in_range
    assert all(wide.within(**{name: own}).in_range for name, own in both.items())


def test_one_row_contradicts_no_box_with_its_soil(rover):
    truth = [1000.0, 0.6, 0.02]
    single = rover.run(**readings(np.random.default_rng(6), truth, 1))
    found = single.within(cohesion=(900.0, 1300.0), friction_angle=(0.55, 0.61))
    assert found.in_range and (found.std <= found.prior_std).all()


def test_the_command_takes_a_narrower_prior_of_the_case(workplace, model_file, capsys):
    wheel = model_file.read_text()
    (workplace / "narrow.toml").write_text(wheel.replace("3000.0", "700.0"))
    rows = readings(np.random.default_rng(5), [600.0, 0.6, 0.015], 8)
    columns = dict(zip(("slip", "load_N", "torque_Nm"), rows.values(), strict=True))
    (workplace / "runs.csv").write_text(csv_text({"run": ["a"] * 8} | columns))
    std = {}
    for case in ("model.toml", "narrow.toml"):
        command = ["estimate", "wheel", "runs.csv", "--model", case, "--by", "run"]
        assert main([*command, "--format", "csv"]) == 0
        captured = capsys.readouterr()
        (row,) = csv.DictReader(captured.out.splitlines())
        std[case] = float(row["cohesion_Pa_std"])
        assert "is ignored" not in captured.err
    assert std["narrow.toml"] < 0.9 * std["model.toml"]
