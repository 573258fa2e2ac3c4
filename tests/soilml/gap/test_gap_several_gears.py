"""Runs of several wheels on one soil: identification and the gap workflow."""

import numpy as np
import pytest
from gap_sets import MODEL, case_of
from remarked import remarked

from soilml import Operating, identify
from soilml.cli.tables import print_table_hints
from soilml.config.explanations import likeliest_with_effects
from soilml.config.write_case import case_as_toml
from soilml.errors import InputError, TableError
from soilml.fitting.candidate_effects import candidate_effects, with_effect
from soilml.fitting.coordinates import select_free, size_coordinate
from soilml.fitting.effect_signatures import effect_signatures
from soilml.fitting.operating_points import operating_points
from soilml.fitting.predictions import forces, linearise, predict
from soilml.fitting.readings import stack_readings
from soilml.gap import gap
from soilml.gap.identifiability import planned_readings
from soilml.io.table import Table
from soilml.physics.effects import EFFECTS
from soilml.quantities import CHANNELS, column

WHEELS = """\
[gears.smooth]
type = "wheel"
radius = 0.15
width = 0.12
[gears.lugged]
type = "wheel"
radius = 0.15
width = 0.12
"""
REST = MODEL[MODEL.index("[soil]") :]
LUGS = '[[gears.lugged.effect]]\nname = "grousers"\nheight = 0.012\n'


def rows(case, gears=("smooth", "lugged"), loads=(40.0, 60.0, 90.0), slips=5, seed=0):
    """Runs of each gear under each load, in mixed order, with noise."""
    rng = np.random.default_rng(seed)
    gear, load, slip = (
        part.ravel()
        for part in np.meshgrid(gears, loads, np.linspace(0.08, 0.6, slips), indexing="ij")
    )
    order = rng.permutation(gear.size)
    gear, load, slip = gear[order], load[order], slip[order]
    run = np.asarray([f"{g}_{w:g}" for g, w in zip(gear, load, strict=True)])
    table = Table({"run": run, "gear": gear, "slip": slip, "load_N": load})
    force = forces(case, operating_points(table))
    for name in CHANNELS:
        true = np.asarray(getattr(force, name))
        std = case.noise[column(name)].std(true)
        table.columns[column(name)] = true + std * rng.standard_normal(true.size)
    return table


def test_rows_of_each_gear_are_predicted_by_its_own_model():
    case = case_of(WHEELS.replace("0.12", "0.10", 1) + LUGS + REST)
    table = rows(case)
    force = forces(case, operating_points(table))
    for name in case.gears:
        mine, own = table["gear"] == name, case.of_gear(name)
        at = Operating(slip=table["slip"][mine], load=table["load_N"][mine])
        np.testing.assert_array_equal(force.torque[mine], own.model(own.soil, at).torque)
        readings = stack_readings(case, table)
        y = predict(case, [], np.zeros((1, 0)), readings)[0]
        torque = y[readings.channel == readings.channels.index("torque")]
        expected = own.model(own.soil, at).torque
        np.testing.assert_allclose(torque[mine], expected, rtol=1e-8)  # integrated as in fits


def test_an_effect_of_one_gear_changes_the_rows_of_that_gear_alone():
    case = case_of(WHEELS + REST)
    readings = stack_readings(case, rows(case))
    own = candidate_effects(case, EFFECTS)["grousers@lugged"]
    shared = candidate_effects(case, EFFECTS)["grousers"]
    on_lugged = np.asarray(readings.at.gear)[readings.row] == "lugged"
    soil = select_free(case, None)
    columns = []
    for effect in (own, shared):
        changed = with_effect(case, effect)
        coordinates = [*soil, size_coordinate(effect, None)]
        columns.append(linearise(changed, coordinates, np.full(4, 0.5), readings).jacobian)
    np.testing.assert_array_equal(columns[0][~on_lugged, 3], 0.0)
    np.testing.assert_array_equal(columns[0][on_lugged, 3], columns[1][on_lugged, 3])
    assert np.any(columns[1][~on_lugged, 3] != 0.0)


def test_an_own_effect_starts_from_the_shared_one_that_it_replaces():
    case = case_of(WHEELS + REST + '[[effect]]\nname = "grousers"\nheight = 0.01\n')
    own = candidate_effects(case, EFFECTS)["grousers@lugged"]
    changed = with_effect(case, own)
    assert changed.parameters()["grousers@lugged.height"][1] == 0.01
    readings = stack_readings(case, rows(case))
    before, after = (predict(c, [], np.zeros((1, 0)), readings) for c in (case, changed))
    np.testing.assert_array_equal(before, after)


def test_running_gear_effects_are_offered_for_each_gear_and_others_once():
    case = case_of(WHEELS + REST)
    names = candidate_effects(case, EFFECTS).keys()
    assert {"grousers", "grousers@smooth", "grousers@lugged", "slip-sinkage"} <= names
    assert not any(n.startswith(("slip-sinkage@", "torque-gain@", "track")) for n in names)
    one = case_of(WHEELS.partition("[gears.lugged]")[0].replace("gears.smooth", "gear") + REST)
    suited = [n for n, e in EFFECTS.items() if e.applies_to(one.model.gear)]
    assert list(candidate_effects(one, EFFECTS)) == suited


def test_two_diameters_make_small_wheel_stiffness_testable():
    alike, two = case_of(WHEELS + REST), case_of(WHEELS.replace("0.15", "0.08", 1) + REST)
    effects = {"small-wheel-stiffness": EFFECTS["small-wheel-stiffness"]}
    readings = stack_readings(alike, rows(alike))
    found, untestable = effect_signatures(alike, readings, effects)
    assert not found and "several diameters" in next(iter(untestable.values())).text
    readings = stack_readings(two, rows(two))
    assert effect_signatures(two, readings, effects)[0][0].name == "small-wheel-stiffness"


@pytest.mark.slow
@pytest.mark.parametrize("method", ["nonlinear", "posterior"])
def test_one_soil_is_identified_from_two_wheels(method):
    case = case_of(WHEELS.replace("0.12", "0.06", 1) + LUGS + REST)
    fit = identify(case, rows(case), method=method)
    true = [case.soil.cohesion, case.soil.friction_angle, case.soil.shear_modulus]
    assert np.all(np.abs(fit.values - true) < 3.5 * fit.std)
    assert fit.remaining_fraction["friction_angle"] < 0.1
    assert not remarked(fit.warnings, "residuals")
    # the rows of the lugged wheel alone say less
    lugged = case.of_gear("lugged")
    part = rows(case).where("gear", "lugged")
    assert identify(lugged, part, method=method).std[1] > fit.std[1]


def test_an_effect_of_one_gear_can_be_identified():
    prior = "[gears.lugged.effect.prior]\nheight = [0.0, 0.03]\n"
    case = case_of(WHEELS + LUGS + prior + REST)
    fit = identify(case, rows(case), method="nonlinear")
    position = fit.names.index("grousers@lugged.height")
    assert abs(fit.values[position] - 0.012) < 3.5 * fit.std[position] < 0.006


def test_tables_that_do_not_fit_the_gears_are_refused():
    case = case_of(WHEELS + REST)
    table = rows(case)
    wrong = Table({**table.columns, "gear": np.where(table["gear"] == "smooth", "rough", "lugged")})
    with pytest.raises(TableError, match=r"'rough' given; the model file has the gears smooth"):
        gap(case, wrong)
    blank = Table({**table.columns, "gear": np.where(table["gear"] == "smooth", "", "lugged")})
    with pytest.raises(TableError, match="the cell is blank"):
        identify(case, blank, method="nonlinear")
    none = Table({k: v for k, v in table.columns.items() if k != "gear"})
    with pytest.raises(TableError, match="column gear is missing"):
        gap(case, none)
    with pytest.raises(TableError, match="the model has one gear"):
        gap(case.of_gear("smooth"), table)
    width = Table({**table.columns, "wheel_width_m": np.full(len(table), 0.2)})
    with pytest.raises(TableError, match="wheel_width_m"):
        gap(case, width)
    with pytest.raises(InputError, match="for one gear"):
        identify(case, table, method="newton")


def test_rows_without_a_name_are_of_the_unnamed_gear():
    case = case_of(WHEELS.replace("gears.smooth", "gear") + LUGS + REST)
    table = rows(case, gears=("gear", "lugged"))
    blank = Table({**table.columns, "gear": np.where(table["gear"] == "gear", "", "lugged")})
    first, second = (
        identify(case, table, method="nonlinear"),
        identify(case, blank, method="nonlinear"),
    )
    np.testing.assert_array_equal(first.values, second.values)


@pytest.mark.slow
def test_lugs_of_one_wheel_are_named_and_written_for_that_wheel():
    """Lugs of one of two wheels that the model takes for equal are that wheel's alone."""
    world = case_of(WHEELS + LUGS + REST)
    report = gap(case_of(WHEELS + REST), rows(world, loads=(40.0, 60.0, 90.0, 140.0), slips=6))
    names = {name for candidate in report.cause_set for name in candidate}
    assert "grousers@lugged" in names and "grousers" not in names
    found = likeliest_with_effects(report.model)
    assert found.parameters()["grousers@lugged.height"][1] == pytest.approx(0.012, rel=0.2)
    assert "grousers@lugged.height" in found.prior
    assert "[[gears.lugged.effect]]" in case_as_toml(found)


@pytest.mark.slow
def test_two_wheels_without_a_gap():
    case = case_of(WHEELS.replace("0.12", "0.08", 1) + REST)
    assert gap(case, rows(case, slips=6)).status == "no-gap"


ROVER = """
[rover]
mass = 20
centre_of_mass = [0.0, 0.0, 0.2]
[rover.wheels]
nose = { position = [0.4, 0.0], gear = "smooth" }
tail = { position = [-0.4, 0.0], gear = "lugged" }
"""


@pytest.mark.slow
def test_wheels_of_a_rover_stand_for_their_gears(capsys):
    case = case_of(WHEELS.replace("0.15", "0.05", 1) + REST + ROVER)
    columns = dict(rows(case, loads=(20.0, 30.0), slips=4).columns)
    own_pass = np.where(columns["gear"] == "smooth", 1.0, 2.0)
    by_gear = Table(columns | {"pass": own_pass})
    wheel = np.where(columns.pop("gear") == "smooth", "nose", "tail")
    by_wheel = Table(columns | {"wheel": wheel})
    np.testing.assert_array_equal(
        planned_readings(case, by_gear).measured, planned_readings(case, by_wheel).measured
    )
    found = [gap(case, table, effects={}).soil_before for table in (by_gear, by_wheel)]
    assert found[0] == found[1]
    deep = by_wheel.rows(wheel == "tail")
    deep.columns["sinkage_m"][:] = 0.1  # above the radius of the nose wheel alone
    print_table_hints(deep, case)
    assert "more than the radius" not in capsys.readouterr().err
