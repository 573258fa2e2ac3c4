"""Synthetic vibration of wheel-legs: what it depends on, reproducible, and mistakes named."""

import numpy as np
import pytest

from datagen.recipe import read_recipe
from datagen.simulation import simulate_rows
from soilml.errors import InputError
from soilml.systems.wheel_legs.stances import GRAVITY, SpringLeg, vibration_amplitude

RECIPE = """\
rows = {rows}
seed = 1
[gear]
type = "midstance"
radius = 0.1482
width = 0.029
arc = 0.2733
leg_length = 0.18
tip_height = 0.0055
[soil]
cohesion = 500.0
friction_angle = 0.625
shear_modulus = 0.006
kc = 0.0
kphi = 600e3
n = 0.7
[soil.prior]
friction_angle = [0.5, 0.75]
kphi = [300e3, 900e3]
[operating]
slip = [0.0, 0.6]
load_N = [15.0, 35.0]
[stick_slip]
stiffness = [3500, 4500]
drop = [0.2, 0.3]
turning = 3.0
"""
STICK_SLIP = "[stick_slip]" + RECIPE.partition("[stick_slip]")[2]
LINE = RECIPE.partition("stiffness =")[0] + 'law = "line"\n'
LINE = LINE.replace("[0.5, 0.75]", "[0.5, 0.7]").replace("900e3", "600e3")


def recipe(tmp_path, text=RECIPE, rows=400):
    (tmp_path / "r.toml").write_text(text.format(rows=rows))
    return read_recipe(tmp_path / "r.toml")


@pytest.mark.slow
def test_vibration_is_that_of_the_spring(tmp_path):
    made = simulate_rows(recipe(tmp_path), 0, 0, 60)
    felt = [
        vibration_amplitude(
            SpringLeg(stiffness=k, hub_mass=load / GRAVITY, turning=3.0), slip, angle, drop
        )
        for k, load, slip, angle, drop in zip(
            *(made[c] for c in ("stick-slip.stiffness", "load_N", "slip", "friction_angle_rad")),
            made["stick-slip.increment"],
            strict=True,
        )
    ]
    np.testing.assert_allclose(made["vibration_m_s2"], felt, rtol=0.03)
    assert np.corrcoef(made["vibration_m_s2"], made["slip"])[0, 1] > 0.4


def test_the_recipe_of_the_paper_has_the_printed_lines(tmp_path):
    """Comin and Saaj 2017: eq. 24 with table V on soils within table I, turning at 0.3 rad/s."""
    made = simulate_rows(read_recipe("wheel_leg_paper"), 0, 0, 300)
    assert (made["status"] == "ok").all()
    a, drop = made["vibration_m_s2"] / GRAVITY, np.rad2deg(made["stick-slip.increment"])
    line = (made["slip"] + 0.882 - 0.022 * drop) / (6.609 - 0.156 * drop)
    felt = line > 0.0
    noise = (a - line)[felt] * GRAVITY / 0.2
    assert np.std(noise) == pytest.approx(1.0, abs=0.15) and abs(noise.mean()) < 0.2
    assert felt.mean() > 0.8


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("turning = 3.0", 'law = "magic"', "law is 'magic'; needed is one of: spring, line"),
        ("drop = [0.2, 0.3]", "", "drop is missing"),
        ("drop = [0.2, 0.3]", "drop = [20, 30]", "fractions of the friction angle"),
        ("stiffness = [3500, 4500]", "stiffness = [5, 4500]", "stiffness is 5"),
        ("turning = 3.0", 'law = "line"', "unknown key 'stiffness'"),
        ("turning = 3.0", "turn = 3.0", "did you mean 'turning'"),
        ("turning = 3.0", "turning = -1.0", "turning is -1"),
        ("turning = 3.0", "hub_mass = 3.0", "unknown key 'hub_mass'"),
        ("slip = [0.0, 0.6]", "slip = [-0.1, 0.6]", "[stick_slip] needs slips of 0 or more"),
        (STICK_SLIP, "[noise]\nvibration_m_s2 = 0.2", "the table [stick_slip] is missing"),
        (STICK_SLIP, "[bias]\nvibration_m_s2 = 0.2", "the table [stick_slip] is missing"),
    ],
)
def test_mistakes_in_a_recipe_are_named(tmp_path, old, new, said):
    with pytest.raises(InputError) as caught:
        recipe(tmp_path, RECIPE.replace(old, new))
    assert said in str(caught.value) and "\n" not in str(caught.value)
