"""Whether a case, a table and a model file are of the same gears, soil, effects and priors."""

import json
from dataclasses import replace

import numpy as np
import pytest
from remarked import remarked

from soilml import EFFECTS, Estimator, LinearWheel, Model, Track
from soilml.config import compatibility as comparing
from soilml.config.measurement_noise import Noise
from soilml.errors import InputError, TableError
from soilml.fitting.operating_points import gear_numbers, operating_points, rows_by_gear
from soilml.fitting.predictions import forces
from soilml.fitting.usable_readings import usable_readings
from soilml.identification import trained_estimator as trained
from soilml.identification.model_error_inputs import with_exact_model
from soilml.io.table import Table
from soilml.numerics.prior import Prior
from soilml.remarks import texts


def wheel(case, **sizes):
    return replace(case, model=replace(case.model, gear=replace(case.model.gear, **sizes)))


def rows(**columns):
    count = max(np.size(v) for v in columns.values())
    every = {"slip": 0.2, "load_N": 60.0, "torque_Nm": 1.0} | columns
    return Table({k: np.broadcast_to(np.asarray(v), (count,)).copy() for k, v in every.items()})


def test_a_recipe_is_nested_dictionaries_or_damaged():
    content = comparing.recipe_content(json.dumps({"gear": {"radius": 1}}), "rows.parquet")
    assert content == {"gear": {"radius": 1.0}} and type(content["gear"]["radius"]) is float
    assert comparing.recipe_case("{}", "rows.parquet") is None
    names = ({"name": ["a"]}, {"name": 5}, {"name": "\x1b[2J"}, {}, "grousers")
    unnamed = [json.dumps({"effect": [name]}) for name in names]
    for text in ("{", "[1]", "3", "[" * 100_000, '{"effect": {}}', *unnamed):
        with pytest.raises(InputError, match=r"rows\.parquet: its recipe is damaged"):
            comparing.recipe_content(text, "rows.parquet")


def test_a_column_of_another_wheel_is_refused_from_half_a_per_cent_on(case):
    radius, width = float(case.model.gear.radius), float(case.model.gear.width)
    sizes = {"radius": radius, "width": width}
    for factor in (1.0, 1.0049, 0.9951):
        table = rows(wheel_radius_m=factor * radius, wheel_width_m=width / factor)
        comparing.check_wheel_columns(table, sizes, "the model's wheel has", "a hint")
    wrong = rows(wheel_width_m=width * np.asarray([1.0, 1.0051, 2.0]))
    with pytest.raises(TableError, match=r"row 2.*wheel_width_m: .* the owner has .*; a hint"):
        comparing.check_wheel_columns(wrong, sizes, "the owner has", "a hint")
    with pytest.raises(TableError, match="wheel_radius_m"):
        comparing.check_wheel_size(case, rows(wheel_radius_m=0.9948 * radius))
    comparing.check_wheel_columns(wrong, {"width": None}, "", "")
    comparing.check_wheel_columns(wrong, {}, "", "")


def test_a_sinkage_beyond_the_diameter_is_not_in_metres(case):
    diameter = 2.0 * float(case.model.gear.radius)
    comparing.check_wheel_size(case, rows(sinkage_m=np.asarray([0.999, -0.999]) * diameter))
    for sign in (1.0, -1.0):
        table = rows(sinkage_m=np.asarray([0.0, sign * 1.001]) * diameter)
        with pytest.raises(TableError, match=r"sinkage_m: .* more than the diameter .*convert it"):
            comparing.check_wheel_size(case, table)


def test_names_of_gears_are_those_of_the_case(case):
    two = replace(case, gears={"narrow": case.model, "wide": wheel(case, width=0.2).model})
    with pytest.raises(TableError, match=r"column gear is missing; .* gears: narrow, wide"):
        comparing.check_wheel_size(two, rows(slip=0.1))
    with pytest.raises(TableError, match=r"column gear: 'other' given; .* narrow, wide"):
        comparing.check_wheel_size(two, rows(gear=np.asarray(["narrow", "other"])))
    with pytest.raises(TableError, match="column gear: the cell is blank"):
        comparing.check_wheel_size(two, rows(gear=np.asarray(["narrow", ""])))
    with pytest.raises(TableError, match="names a, b, and the model has one gear"):
        comparing.check_wheel_size(case, rows(gear=np.asarray(["a", "b", ""])))
    comparing.check_wheel_size(case, rows(gear=np.asarray(["a", "a"])))
    names = np.asarray(["wide", "narrow"])
    comparing.check_wheel_size(two, rows(gear=names, wheel_width_m=np.asarray([0.2, 0.12])))
    with pytest.raises(TableError, match=r"wheel_width_m: 0\.12 given"):
        comparing.check_wheel_size(two, rows(gear=names, wheel_width_m=np.asarray([0.12, 0.12])))


def test_rows_go_to_the_gear_that_drove_them(case):
    two = replace(case, gears={"narrow": case.model, "wide": wheel(case, width=0.2).model})
    slip, names = np.asarray([0.1, 0.3, 0.5]), np.asarray(["wide", "narrow", "wide"])
    at = operating_points(rows(slip=slip, gear=names, speed_m_s=np.asarray([0.1, 0.2, np.nan])))
    assert at.speed is None and gear_numbers(at).tolist() == [1, 0, 1]
    parts = {part.case.model.gear.width: part.rows.tolist() for part in rows_by_gear(two, at)}
    assert parts == {0.12: [1], 0.2: [0, 2]}
    found = forces(two, at)
    for i, name in enumerate(names):
        alone = two.gears[name](case.soil, replace(at, gear=None, slip=slip[i], load=60.0))
        assert found.torque[i] == pytest.approx(float(alone.torque), rel=1e-9)
    assert found.status.dtype == np.int64
    unnamed = operating_points(rows(slip=slip, speed_m_s=0.1))
    assert gear_numbers(unnamed).tolist() == [0, 0, 0] and (unnamed.speed == 0.1).all()
    assert [part.rows.tolist() for part in rows_by_gear(two, unnamed)] == [[0, 1, 2]]


def soil_with(case, **values):
    return replace(case, soil=replace(case.soil, **values))


def with_effects(case, *effects):
    return replace(case, model=Model(case.model.gear, effects))


OWN, ITS = Prior(1.0, 3000.0), ", the model file has [1.0, 3000.0]"
DIGS, PUSHES = EFFECTS["slip-sinkage"](n1=0.2), EFFECTS["bulldozing"]()
#: What is compared, both cases made of one, and what is said of the other one.
DIFFERENCES = [
    *((comparing.gear_differences, lambda c, f=f: (c, wheel(c, radius=0.15 * f)), said)
      for f, said in ((1.0049, ""), (1.0055, "gear.radius 0.150825, the model file has 0.15"))),
    (comparing.gear_differences,
     lambda c: (c, replace(c, model=Model(LinearWheel(radius=0.15, width=0.12)))),
     "gear type 'linear-wheel', the model file has 'wheel'"),
    (comparing.gear_differences,  # what the other varies has no value
     lambda c: (c, replace(wheel(c, radius=0.2), prior={"gear.radius": Prior(0.1, 0.2)})), ""),
    (comparing.gear_differences, lambda c: (c, soil_with(c, n=2.0)), ""),
    *((comparing.value_differences, lambda c, f=f: (c, soil_with(c, n=c.soil.n * f)), said)
      for f, said in ((1.0009, ""), (1.0012, "n 1.10132, the model file has 1.1"))),
    (comparing.value_differences, lambda c: (c, soil_with(c, cohesion=9.0)), ""),
    (comparing.value_differences, lambda c: (c, replace(soil_with(c, cohesion=9.0), prior={})),
     "cohesion 9, the model file has 1040"),
    (comparing.effect_differences, lambda c: (c, with_effects(c, DIGS)),
     "effects slip-sinkage, the model file has none"),
    (comparing.effect_differences, lambda c: (with_effects(c, DIGS), with_effects(c, DIGS, PUSHES)),
     "effects bulldozing, slip-sinkage, the model file has slip-sinkage"),
    (comparing.effect_differences, lambda c: (with_effects(c, DIGS),) * 2, ""),
    *((lambda a, b: comparing.prior_differences(a, b, ["cohesion", "n"]),
       lambda c, other=other: (replace(c, prior={"cohesion": OWN}),
                               replace(c, prior={"cohesion": other} if other else {})), said)
      for other, said in (
          (OWN, ""), (Prior(1.0009, 2998.0), ""),
          (Prior(1.002, 3000.0), f"prior [1.002, 3000.0] of cohesion{ITS}"),
          (Prior(1.0, 2990.0), f"prior [1.0, 2990.0] of cohesion{ITS}"),
          (Prior(1.0, 3000.0, log=True), f" of cohesion{ITS}"),
          (None, f"no prior of cohesion{ITS}"))),
]  # fmt: skip


@pytest.mark.parametrize(("compare", "cases", "said"), DIFFERENCES)
def test_differences_are_told_from_a_small_share_on(case, compare, cases, said):
    found = list(compare(*cases(case)))
    assert len(found) == bool(said) and all(one.endswith(said) for one in found)


def test_grousers_that_the_model_lacks_and_several_runs_are_noted(case):
    table = rows(run=np.asarray(["a", "b"]), grouser_height_m=np.asarray([0.01, np.nan]))
    assert texts(usable_readings(case, table).notes) == [
        "2 runs are fitted as one soil",
        "grouser_height_m is 0.01, but the model has no effect grousers",
    ]
    lugged = replace(case, model=case.model + EFFECTS["grousers"](height=0.01))
    assert texts(usable_readings(lugged, table).notes) == ["2 runs are fitted as one soil"]
    none = rows(run=np.asarray(["a", "a"]), grouser_height_m=0.0)
    assert usable_readings(case, none).notes == ()


@pytest.fixture(scope="module")
def any_wheel():
    return Estimator.load("exported/any_wheel.onnx")


def fitting(case, estimator, **changes):
    """The case with the priors and the angle of maximum stress of a file for any wheel."""
    prior = {
        name: Prior(float(low), float(high))
        for name, low, high in zip(
            estimator.names, estimator.prior.lower, estimator.prior.upper, strict=True
        )
    }
    own = {"cohesion": Prior(0.0, 3000.0), "shear_modulus": Prior(0.005, 0.03)}
    soil = replace(case.soil, a0=0.4, a1=0.15)
    return replace(case, soil=soil, prior=prior | own | changes)


def test_a_file_for_any_wheel_takes_wheel_and_soil_of_the_case(case, any_wheel):
    fitted = fitting(case, any_wheel)
    found, warnings = trained.condition_on_case(any_wheel, fitted)
    assert remarked(warnings, "kphi") and found.sets.context_values["bearing_std"] == 0.4
    exact, warnings = trained.condition_on_case(with_exact_model(any_wheel), fitted)
    assert not remarked(warnings, "kphi") and exact.sets.context_values["bearing_std"] == 0.0
    assert dict(zip(found.names, found.prior.upper, strict=True))["cohesion"] == pytest.approx(3e3)
    again, _ = trained.condition_on_case(any_wheel, wheel(fitted, radius=0.2))
    table = {"slip": [0.2, 0.4], "load": [60.0, 60.0], "torque": [1.5, 2.5]}
    values = [np.asarray(e.run(**table).mean) for e in (found, again)]
    assert not np.allclose(values[0], values[1])
    with pytest.raises(InputError, match="is for rigid wheels, not for a track"):
        track = Track(radius=0.1, width=0.08, base=0.6)
        trained.condition_on_case(any_wheel, replace(fitted, model=Model(track)))
    with pytest.raises(InputError, match="has no effects, the model has slip-sinkage"):
        dug = replace(fitted, model=fitted.model + EFFECTS["slip-sinkage"](n1=0.2))
        trained.condition_on_case(any_wheel, dug)
    for name, value in (("a0", 0.401), ("a1", 0.149)):
        with pytest.raises(InputError, match=f"is for {name} = 0.*the model has {value:g}"):
            other = replace(fitted, soil=replace(fitted.soil, **{name: value}))
            trained.condition_on_case(any_wheel, other)
    for name in ("cohesion", "shear_modulus"):
        without = {k: v for k, v in fitted.prior.items() if k != name}
        with pytest.raises(InputError, match=f"{name} has no prior"):
            trained.condition_on_case(any_wheel, replace(fitted, prior=without))


def test_a_prior_of_the_bearing_that_is_wider_than_the_file_allows_is_said(case, any_wheel):
    kphi = float(case.soil.kphi)
    for factor, said in ((1.2, False), (1000.0, True)):
        own = Prior(kphi / factor, kphi * factor, log=True)
        _, warnings = trained.condition_on_case(any_wheel, fitting(case, any_wheel, kphi=own))
        assert remarked(warnings, "intervals may be too narrow") == said


def test_priors_that_a_file_ignores_are_named_and_narrower_ones_are_used(case, any_wheel):
    fitted = fitting(case, any_wheel)
    found, warnings = trained.condition_on_case(with_exact_model(any_wheel), fitted)
    assert warnings == [] and trained.narrower_priors(found, fitted) == {}
    i = found.names.index("friction_angle")
    low, high = float(found.prior.lower[i]), float(found.prior.upper[i])
    width = high - low

    def with_angle(lower, upper, **kind):
        changed = fitting(case, any_wheel, friction_angle=Prior(lower, upper, **kind))
        remarks = trained._prior_differences(found, changed)
        return trained.narrower_priors(found, changed), texts(remarks)

    # less than a fiftieth of the width is no difference
    assert with_angle(low + 0.019 * width, high - 0.019 * width) == ({}, [])
    used, said = with_angle(low + 0.1 * width, high)
    assert said == [] and used["friction_angle"] == pytest.approx((low + 0.1 * width, high))
    used, said = with_angle(low - 0.01 * width, high - 0.3 * width)
    assert said == [] and used["friction_angle"] == pytest.approx((low, high - 0.3 * width))
    for ends in ((low - 0.1 * width, high), (low, high + 0.1 * width)):
        used, said = with_angle(*ends)
        assert used == {} and len(said) == 1
        assert said[0].startswith(f"friction_angle: the file's prior is uniform from {low:.4g} to")
    used, said = with_angle(low + 0.1 * width, high, log=True)
    assert used == {} and "that of the model is ignored" in said[0]
    used, said = with_angle(low, high, normal_std=0.1)
    assert used == {} and len(said) == 1
    other = fitting(case, any_wheel, n=Prior(0.8, 1.2), kphi=Prior(1e5, 1e7))
    assert texts(trained._prior_differences(found, other)) == [
        "n: fixed at the model's values; their priors are ignored"
    ]
    unknown = {k: v for k, v in fitted.prior.items() if k != "friction_angle"}
    assert len(trained._prior_differences(found, replace(fitted, prior=unknown))) == 1


def test_a_file_for_simulated_rows_has_no_errors_that_rows_share(case, any_wheel):
    table = {"slip": [0.2, 0.4, 0.6], "load": [60.0] * 3, "torque": [1.5, 2.3, 3.0]}
    fitted = replace(fitting(case, any_wheel), noise={"torque_Nm": Noise(share=0.02)})
    exact = trained.for_simulated_case(any_wheel, fitted).run(**table)
    biased, _ = trained.condition_on_case(any_wheel, fitted)
    assert (np.asarray(exact.std) <= np.asarray(biased.run(**table).std) * (1 + 1e-6)).all()
    assert (np.asarray(exact.std) < 0.999 * np.asarray(biased.run(**table).std)).any()
    single = Estimator.load("wheel_linear")
    assert trained.for_simulated_case(single, fitted) is single


def test_a_file_takes_noise_and_biases_of_the_case(case, any_wheel):
    bias = {
        "torque_Nm": Noise(share=0.03, constant=0.4),
        "slip": Noise(constant=0.012),
        "load_N": Noise(share=0.05),
    }
    noise = {"torque_Nm": Noise(share=0.02, constant=0.3), "slip": Noise(constant=0.01)}
    found = trained.with_sensors_of(any_wheel, replace(case, noise=noise, bias=bias)).sets
    assert found.noise["torque"] == (0.3, 0.02) and found.noise["slip"] == (0.01, 0.0)
    assert found.noise["torque_bias"] == (0.4, 0.0)
    expected = any_wheel.sets.common_errors | {
        "torque_gain": 0.03, "slip_bias": 0.012, "load_gain": 0.05
    }  # fmt: skip
    assert found.common_errors == expected != any_wheel.sets.common_errors
