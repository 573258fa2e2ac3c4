"""Model files with several gears on one soil."""

import numpy as np
import pytest

from soilml import Operating, read_case
from soilml.config.case import read_case_of_one_gear
from soilml.config.write_case import case_as_toml
from soilml.errors import InputError
from soilml.fitting.predictions import forces
from soilml.numerics.prior import Prior

GEARS = """\
[gears.smooth]
type = "wheel"
radius = 0.15
width = 0.12
[gears.lugged]
type = "wheel"
radius = 0.15
width = 0.10
[[gears.lugged.effect]]
name = "grousers"
height = 0.01
[gears.lugged.effect.prior]
height = [0.0, 0.02]
"""
REST = """\
[soil]
name = "wong1989/dry_sand"
[soil.prior]
friction_angle = [0.3, 0.8]
[[effect]]
name = "slip-sinkage"
n1 = 0.3
[effect.prior]
n1 = [0.0, 1.0]
[noise]
torque_Nm = "2 %"
"""


UNNAMED = '[gear]\ntype = "wheel"\nradius = 0.2\nwidth = 0.1\n'


def case_of(tmp_path, text, **options):
    path = tmp_path / "model.toml"
    path.write_text(text)
    return read_case(path, **options)


def test_each_gear_has_its_dimensions_and_effects_and_shares_the_rest(tmp_path):
    case = case_of(tmp_path, GEARS + REST)
    smooth, lugged = case.of_gear("smooth"), case.of_gear("lugged")
    assert (smooth.model.gear.width, lugged.model.gear.width) == (0.12, 0.10)
    assert [e.name for e in smooth.model.effects] == ["slip-sinkage"]
    assert [e.name for e in lugged.model.effects] == ["slip-sinkage", "grousers"]
    assert smooth.prior.keys() == {"friction_angle", "slip-sinkage.n1"}
    assert lugged.prior["grousers.height"] == Prior(0.0, 0.02)
    assert case.prior["grousers@lugged.height"] == Prior(0.0, 0.02)


def test_explanations_of_gears_are_read_and_written_and_mixed(tmp_path):
    several = """
[[explanation]]
weight = 0.6
[[explanation.effect]]
name = "grousers"
gear = "lugged"
height = 0.008
[explanation.effect.prior]
height = [0.004, 0.012]
[[explanation]]
weight = 0.3
[explanation.soil]
friction_angle = 0.5
[[explanation.effect]]
name = "bulldozing"
"""
    with pytest.raises(InputError, match=r"has 2 explanations .* keep one"):
        case_of(tmp_path, GEARS + REST + several)
    case = case_of(tmp_path, GEARS + REST + several, with_explanations=True)
    first, second = (case.of_explanation(one) for one in case.explanations)
    assert first.gears["lugged"].effects[0].height == 0.008
    assert first.prior["grousers@lugged.height"] == Prior(0.004, 0.012)
    assert [e.name for e in second.model.effects] == ["slip-sinkage", "bulldozing"]
    assert case_of(tmp_path, case_as_toml(case), with_explanations=True) == case
    at = Operating(slip=np.asarray([0.1, 0.4]), load=60.0)
    pull = [
        np.asarray(forces(one.of_gear("lugged"), at).drawbar_pull) for one in (case, first, second)
    ]
    np.testing.assert_allclose(pull[0], (0.6 * pull[1] + 0.3 * pull[2]) / 0.9, rtol=1e-12)
    assert case.without_explanations().gears == case.gears
    for wrong in ("weight = 0.9", "weight = 1.5"):
        with pytest.raises(InputError, match="weight"):
            case_of(tmp_path, GEARS + REST + several.replace("weight = 0.6", wrong))


def test_a_suspected_effect_of_an_earlier_file_is_its_only_explanation(tmp_path):
    marked = (GEARS + REST).replace("n1 = 0.3", "suspected = true\nn1 = 0.3")
    case = case_of(tmp_path, marked, with_explanations=True)
    assert case.model.effects == () and [e.weight for e in case.explanations] == [1.0]
    assert [e.name for e in case_of(tmp_path, marked).model.effects] == ["slip-sinkage"]
    with pytest.raises(InputError, match="unknown key 'suspected'"):
        case_of(tmp_path, marked + "\n[[explanation]]\nweight = 0.4\n")
    with pytest.raises(InputError, match=r"effect is 3; needed is tables \[\[effect\]\]"):
        case_of(tmp_path, "effect = 3\n" + GEARS + REST.partition("[[effect]]")[0])


def test_parameters_of_gears_are_set_by_path(tmp_path):
    case = case_of(tmp_path, GEARS + REST)
    new = {"gears.smooth.radius": 0.2, "grousers@lugged.height": 0.015, "slip-sinkage.n1": 0.1}
    changed = case.with_values(new | {"cohesion": 7.0})
    assert changed.of_gear("smooth").model.gear.radius == 0.2
    assert changed.of_gear("lugged").model.gear.radius == 0.15
    effects = changed.of_gear("lugged").model.effects
    assert (effects[0].n1, effects[1].height, changed.soil.cohesion) == (0.1, 0.015, 7.0)
    assert changed.parameters()["grousers@lugged.height"][1] == 0.015
    with pytest.raises(InputError, match=r"no parameter 'grousers@smooth.height'"):
        case.with_values({"grousers@smooth.height": 0.01})


def test_a_gears_own_effect_replaces_the_shared_one(tmp_path):
    shared = '[[effect]]\nname = "grousers"\nheight = 0.005\n'
    case = case_of(tmp_path, GEARS + REST + shared)
    heights = [case.of_gear(g).parameters()["grousers.height"][1] for g in ("smooth", "lugged")]
    assert heights == [0.005, 0.01]
    assert "grousers.height" in case.paths_of_gear("smooth")
    assert "grousers.height" not in case.paths_of_gear("lugged")


@pytest.mark.parametrize("unnamed", ["", UNNAMED])
def test_a_written_case_is_read_back(tmp_path, unnamed):
    case = case_of(tmp_path, unnamed + GEARS + REST)
    again = case_of(tmp_path, case_as_toml(case, ["a comment"]))
    assert again == case
    assert list(again.gears) == [*(["gear"] if unnamed else []), "smooth", "lugged"]


def test_an_unnamed_gear_can_have_effects_of_its_own_beside_named_ones(tmp_path):
    own = '[[gear.effect]]\nname = "wheel-flexibility"\ncompliance = 1e-5\n'
    case = case_of(tmp_path, UNNAMED + own + GEARS + REST)
    assert case.parameters()["wheel-flexibility@gear.compliance"][1] == 1e-5
    assert case.parameters()["gear.radius"][1] == 0.2
    assert case_of(tmp_path, case_as_toml(case)) == case


MISTAKES = {
    "unknown effect": ("grousers", "lugs", "there are: slip-sinkage, grousers"),
    "wrong name": ("gears.smooth", 'gears."a b"', "letters, digits"),
    "name of the unnamed gear": ("[gears.smooth]", f"{UNNAMED}[gears.gear]", "take another"),
    "missing width": ("width = 0.12\n", "", r"\[gears.smooth\]: width is missing"),
    "unknown key": ("width = 0.12\n", "width = 0.12\nlugs = 3\n", "unknown key 'lugs'"),
    "effect of a track for all": (
        "[noise]",
        '[[effect]]\nname = "track-grousers"\n[noise]',
        "does not apply",
    ),
}


@pytest.mark.parametrize(("old", "new", "said"), MISTAKES.values(), ids=MISTAKES)
def test_mistakes_are_said_with_their_place(tmp_path, old, new, said):
    with pytest.raises(InputError, match=said):
        case_of(tmp_path, (GEARS + REST).replace(old, new, 1))


def test_an_effect_that_all_share_must_suit_all_gears(tmp_path):
    foot = '[gears.foot]\ntype = "linear-wheel"\nradius = 0.1\nwidth = 0.1\n'
    text = GEARS + foot + REST + '[[effect]]\nname = "grousers"\nheight = 0.01\n'
    assert "foot" in case_of(tmp_path, text).gears  # a linear wheel is a rigid one
    track = '[gears.foot]\ntype = "midstance"\n'
    with pytest.raises(InputError):
        case_of(tmp_path, text.replace(foot, track))


def test_commands_for_one_gear_ask_which(tmp_path):
    path = tmp_path / "model.toml"
    path.write_text(GEARS + REST)
    with pytest.raises(InputError, match="several gears: smooth, lugged; choose one with --gear"):
        read_case_of_one_gear(path)
    with pytest.raises(InputError, match="no gear 'rough'"):
        read_case_of_one_gear(path, gear="rough")
    lugged = read_case_of_one_gear(path, gear="lugged")
    force = lugged.model(lugged.soil, Operating(slip=np.asarray([0.2]), load=60.0))
    smooth = read_case_of_one_gear(path, gear="smooth")
    bare = smooth.model(smooth.soil, Operating(slip=np.asarray([0.2]), load=60.0))
    assert force.torque[0] > bare.torque[0]
    path.write_text(GEARS.replace("gears.smooth", "gear").partition("[gears")[0] + REST)
    with pytest.raises(InputError, match="omit --gear"):
        read_case_of_one_gear(path, gear="lugged")
