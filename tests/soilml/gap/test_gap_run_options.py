"""Runs that can be proposed: every kind with its slips, loads and covariates."""

from dataclasses import replace

import pytest
from gap_sets import case_of, driven

from soilml.fitting.readings import stack_readings
from soilml.gap.run_options import run_options

CASE = case_of()


def options(case=CASE, loads=(40.0, 60.0, 90.0), changed=None, **covariates):
    """The proposed runs by kind, for runs driven at slips of 0.06 to 0.6 under these loads."""
    readings = stack_readings(CASE, driven(CASE, loads=loads, **covariates))
    if changed:
        readings = replace(readings, at=replace(readings.at, **changed))
    found = list(run_options(readings, case, ()))
    assert len({o.kind for o in found}) == len(found)
    return {o.kind: o for o in found}


USUAL = [0.05, 0.15, 0.2, 0.3, 0.35, 0.45, 0.5, 0.6]


def test_every_kind_of_run():
    found = options()
    assert list(found) == [
        *("heavier", "lighter", "higher slip", "low slip", "braking", "reverse"),
        *("other speed", "second pass", "slip angle"),
    ]
    slips = {kind: o.at.slip.tolist() for kind, o in found.items()}
    loads = {kind: set(o.at.load.tolist()) for kind, o in found.items()}
    for kind in ("heavier", "lighter", "reverse", "other speed", "second pass", "slip angle"):
        assert slips[kind] == pytest.approx(USUAL)
    assert slips["higher slip"] == pytest.approx([0.6, 0.63, 0.66, 0.69, 0.71, 0.74, 0.77, 0.8])
    assert slips["low slip"] == pytest.approx([0.01, 0.03, 0.04, 0.06, 0.07, 0.09, 0.1, 0.12])
    assert slips["braking"] == pytest.approx([-0.4, -0.35, -0.3, -0.25, -0.2, -0.15, -0.1, -0.05])
    assert loads["heavier"] == {135.0} and loads["lighter"] == {24.0}
    for kind in set(found) - {"heavier", "lighter"}:
        assert loads[kind] == {60.0}
    assert found["higher slip"].text == "slips up to 0.8 under 60 N"
    assert found["heavier"].text == "the same slips under 135 N" and not found["heavier"].plain


def test_a_run_that_differs_by_a_covariate_has_a_plain_one_beside_it():
    found = options()
    covariates = {
        "reverse": ("speed", -0.05),
        "other speed": ("speed", 0.5),
        "second pass": ("pass_number", 2.0),
        "slip angle": ("slip_angle", 0.2),
    }
    for kind, (name, value) in covariates.items():
        assert getattr(found[kind].at, name).tolist() == [value] * 8
        plain = found[kind].plain
        assert getattr(plain, name) is None and plain.slip is not None
    assert found["other speed"].text == "the same slips ten times as fast, at 0.5 m/s, under 60 N"
    assert found["second pass"].text == "the same slips again in the same rut under 60 N"
    assert found["slip angle"].text == "the wheel at a slip angle of 0.2 rad under 60 N"
    assert found["reverse"].text == "the same slips in reverse under 60 N"


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
    found = {(o.kind, str(o.at.gear[0])): o for o in run_options(readings, several, ())}
    kinds = {kind for kind, _ in found}
    assert len(found) == 2 * len(kinds) == 18
    for (kind, gear), option in found.items():
        assert option.text.endswith(f", with the gear {gear}")
        if kind in ("reverse", "other speed", "second pass", "slip angle"):
            assert set(option.plain.gear.tolist()) == {gear}
        else:
            assert option.plain is None
