"""Runs that can be proposed: every kind with its slips, loads and covariates."""

from dataclasses import replace

import numpy as np
import pytest
from gap_sets import case_of, driven

from soilml.fitting.readings import stack_readings
from soilml.gap.run_options import CHECKS, run_options
from soilml.parameters import declared
from soilml.physics.effects import EFFECTS
from soilml.physics.soils import Soil

CASE = case_of()


def options(case=CASE, loads=(40.0, 60.0, 90.0), changed=None, **covariates):
    """The proposed runs by kind, for runs driven at slips of 0.06 to 0.6 under these loads."""
    readings = stack_readings(CASE, driven(CASE, loads=loads, **covariates))
    if changed:
        readings = replace(readings, at=replace(readings.at, **changed))
    found = list(run_options(readings, case))
    assert len({o.kind for o in found}) == len(found)
    return {o.kind: o for o in found}


USUAL = [0.05, 0.15, 0.2, 0.3, 0.35, 0.45, 0.5, 0.6]


#: By kind: slips, load, what it is called, and the covariate that a plain run beside it lacks.
EVERY = {
    "heavier": (USUAL, 135.0, "the same slips under 135 N", None),
    "lighter": (USUAL, 24.0, "the same slips under 24 N", None),
    "higher slip": (np.linspace(0.6, 0.8, 8).round(2), 60.0, "slips up to 0.8 under 60 N", None),
    "low slip": (np.linspace(0.01, 0.12, 8).round(2), 60.0, "slips close to zero under 60 N", None),
    "braking": (np.linspace(-0.4, -0.05, 8).round(2), 60.0, " under 60 N", None),
    "reverse": (USUAL, 60.0, "the same slips in reverse under 60 N", ("speed", -0.05)),
    "other speed": (
        USUAL, 60.0, "the same slips ten times as fast, at 0.5 m/s, under 60 N", ("speed", 0.5)
    ),
    "second pass": (
        USUAL, 60.0, "the same slips again in the same rut under 60 N", ("pass_number", 2.0)
    ),
    "slip angle": (
        USUAL, 60.0, "the wheel at a slip angle of 0.2 rad under 60 N", ("slip_angle", 0.2)
    ),
}  # fmt: skip


def test_every_kind_of_run():
    found = options()
    assert list(found) == list(EVERY)
    for kind, (slips, load, text, covariate) in EVERY.items():
        run = found[kind]
        assert run.at.slip == pytest.approx(np.asarray(slips))
        assert set(run.at.load.tolist()) == {load} and text in run.text
        if covariate is None:
            assert not run.plain
            continue
        name, value = covariate
        assert getattr(run.at, name).tolist() == [value] * 8
        assert getattr(run.plain, name) is None and run.plain.slip is not None


def test_covariates_of_the_driven_rows_are_kept():
    found = options(speed=[0.02] * 3, pass_number=[1.0, 2.0, 3.0])
    assert found["other speed"].at.speed.tolist() == [pytest.approx(0.2)] * 8
    assert found["reverse"].at.speed.tolist() == [-0.02] * 8
    assert "second pass" not in found  # passes were varied
    assert found["heavier"].at.speed.tolist() == [0.02] * 8
    assert found["heavier"].at.pass_number.tolist() == [1.0] * 8
    still = options(speed=[0.0] * 3)
    assert still["other speed"].at.speed.tolist() == [0.5] * 8
    fast = options(speed=[1.5] * 3)["other speed"]
    assert fast.at.speed.tolist() == [pytest.approx(0.15)] * 8  # ten times is beyond 10 m/s
    assert fast.text == "the same slips a tenth as fast, at 0.15 m/s, under 60 N"
    assert options(speed=[1.0] * 3)["other speed"].at.speed.tolist() == [pytest.approx(10.0)] * 8
    varied = options(speed=[0.02, 0.1, 0.5])
    assert "other speed" not in varied and "reverse" in varied
    assert "reverse" not in options(speed=[-0.02, 0.1, 0.5])


def test_with_several_gears_each_run_is_proposed_for_each():
    readings = stack_readings(CASE, driven(CASE))
    several = replace(CASE, gears={"lugged": CASE.model, "smooth": CASE.model})
    found = {(o.kind, str(o.at.gear[0])): o for o in run_options(readings, several)}
    kinds = {kind for kind, _ in found}
    assert len(found) == 2 * len(kinds) == 18
    for (kind, gear), option in found.items():
        assert option.text.endswith(f", with the gear {gear}")
        if kind in ("reverse", "other speed", "second pass", "slip angle"):
            assert set(option.plain.gear.tolist()) == {gear}
        else:
            assert option.plain is None


def test_checks_measure_sizes_of_effects_and_the_soil():
    sizes = {f"{name}.{effect.about.size}" for name, effect in EFFECTS.items()}
    measured = [path for _, stds in CHECKS.values() for path in stds]
    assert set(measured) <= sizes | set(declared(Soil))
