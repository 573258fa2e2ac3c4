"""Model files: what can be written, and what is said of mistakes."""

import pytest
from conftest import MODEL

from soilml import read_case
from soilml.config.measurement_noise import Discrepancy, Noise
from soilml.config.write_case import case_as_toml
from soilml.errors import InputError
from soilml.numerics.prior import Prior


def written(tmp_path, text):
    (tmp_path / "model.toml").write_text(text)
    return tmp_path / "model.toml"


def test_reads_everything_a_model_file_may_hold(tmp_path):
    case = read_case(
        written(
            tmp_path,
            MODEL.replace('torque_Nm = "2 %"', 'torque_Nm = "2 % + 0.05"\nsinkage_m = 0.0005')
            + '[[effect]]\nname = "slip-sinkage"\nn1 = 0.4\n[effect.prior]\nn1 = [0.0, 1.0]\n'
            + '[[effect]]\nname = "exit-angle"\nkappa = 0.1\n',
        )
    )
    assert case.model.gear.radius == 0.15
    assert [e.name for e in case.model.effects] == ["slip-sinkage", "exit-angle"]
    assert case.noise == {"torque_Nm": Noise(0.05, 0.02), "sinkage_m": Noise(0.0005)}
    assert case.prior["cohesion"] == Prior(0.0, 3000.0)
    assert case.prior["slip-sinkage.n1"] == Prior(0.0, 1.0)
    assert case.soil.kphi == 1528430.0
    changed = case.with_values({"slip-sinkage.n1": 0.2, "cohesion": 5.0, "gear.width": 0.1})
    assert changed.model.effects[0].n1 == 0.2
    assert changed.soil.cohesion == 5.0
    assert changed.model.gear.width == 0.1


def test_the_law_of_braking_is_read_and_written_where_it_is_not_the_default(tmp_path):
    case = read_case(written(tmp_path, MODEL))
    assert case.model.gear.braking == "displacement-sign"
    assert "braking" not in case_as_toml(case)
    printed = MODEL.replace("width = 0.12", 'width = 0.12\nbraking = "slip-sign"')
    case = read_case(written(tmp_path, printed))
    assert case.model.gear.braking == "slip-sign"
    assert read_case(written(tmp_path, case_as_toml(case))).model.gear.braking == "slip-sign"


def test_a_soil_needs_no_name_when_all_its_values_are_given(tmp_path):
    text = MODEL.replace(
        'name = "wong1989/dry_sand"',
        "cohesion = 500\nfriction_angle = 0.5\nshear_modulus = 0.01\nkc = 0\nkphi = 1e6\nn = 1",
    )
    soil = read_case(written(tmp_path, text)).soil
    assert (soil.cohesion, soil.kphi, soil.a0) == (500.0, 1e6, 0.4)


def test_a_range_may_be_logarithmic(tmp_path):
    text = MODEL.replace("[0.005, 0.03]", '{ range = [0.001, 0.1], scale = "log" }')
    prior = read_case(written(tmp_path, text)).prior["shear_modulus"]
    assert prior.log
    assert prior.at(0.5) == pytest.approx(0.01)


def test_normal_priors_are_read_and_written(tmp_path):
    effects = (
        '[[effect]]\nname = "slip-sinkage"\n[effect.prior]\nn1 = { half-normal = 0.2 }\n'
        '[[effect]]\nname = "slip-offset"\n[effect.prior]\noffset = { normal = 0.06 }\n'
    )
    case = read_case(written(tmp_path, MODEL + effects))
    assert case.prior["slip-sinkage.n1"] == Prior(0.0, 0.8, normal_std=0.2)
    assert case.prior["slip-offset.offset"] == Prior(-0.2, 0.2, normal_std=0.06)  # its bounds
    again = read_case(written(tmp_path, case_as_toml(case)))
    assert again.prior == case.prior


DISCREPANCY = """
[discrepancy]
torque_Nm = "2 %"
drawbar_pull_N = 0.4
sinkage_m = "1 % + 0.0003"
"""


def test_discrepancy_is_read_written_and_read_again(tmp_path):
    case = read_case(written(tmp_path, MODEL + DISCREPANCY + "log_load_length = 0.4\n"))
    assert case.discrepancy == {
        "torque_Nm": Discrepancy(share=0.02, log_load_length=0.4),
        "drawbar_pull_N": Discrepancy(constant=0.4, log_load_length=0.4),
        "sinkage_m": Discrepancy(0.0003, 0.01, log_load_length=0.4),
    }
    again = read_case(written(tmp_path, case_as_toml(case)))
    assert again.discrepancy == case.discrepancy
    assert case.with_values({"cohesion": 5.0}).discrepancy == case.discrepancy
    assert "length" not in case_as_toml(read_case(written(tmp_path, MODEL + DISCREPANCY)))


def test_lengths_that_differ_between_channels_cannot_be_written(tmp_path):
    case = read_case(written(tmp_path, MODEL + DISCREPANCY))
    case.discrepancy["torque_Nm"] = Discrepancy(share=0.02, slip_length=0.1)
    with pytest.raises(ValueError, match="differ in slip_length"):
        case_as_toml(case)


EXITS = '[[effect]]\nname = "exit-angle"\n'
MISTAKES = {
    "no such type": ('type = "wheel"', 'type = "wheels"', "wheel, linear-wheel"),
    "missing width": ("width = 0.12", "", "width is missing"),
    "misspelt key": ("width = 0.12", "widht = 0.12\nwidth = 0.12", "did you mean 'width'"),
    "negative radius": ("radius = 0.15", "radius = -0.15", "radius is -0.15"),
    "no such law": ("width = 0.12", 'width = 0.12\nbraking = "no"', "there are: displacement-sign"),
    "number for a law": ("width = 0.12", "width = 0.12\nbraking = 1.0", "needed is a text"),
    "law of another gear": ('"wheel"', '"track"\nbase = 0.5\nbraking = "slip-sign"', "unknown key"),
    "text for a number": ("radius = 0.15", 'radius = "big"', "needed is a number"),
    "degrees": ("[soil.prior]", "friction_angle = 34\n[soil.prior]", "write 0.5934"),
    "unknown soil": ("wong1989/dry_sand", "wong1989/dry_sands", "soilml show soils"),
    "unknown prior": ("cohesion = [", "cohesoin = [", "did you mean 'cohesion'"),
    "normal prior of a positive value": (
        "[0.0, 3000.0]",
        "{ normal = 500.0 }",
        "half-normal = 500",
    ),
    "normal prior without width": ("[0.0, 3000.0]", "{ normal = 0.0 }", "above zero"),
    "prior upside down": ("[0.0, 3000.0]", "[3000.0, 0.0]", "lower below upper"),
    "prior outside": ("[0.0, 3000.0]", "[-5.0, 3000.0]", "must lie between"),
    "noise without unit": ("torque_Nm", "torque", "did you mean 'torque_Nm'"),
    "noise of zero": ('"2 %"', "0.0", "above zero"),
    "noise in words": ('"2 %"', '"two percent"', "2 %"),
    "unknown table": ("[noise]", "[noises]\n[noise]", "did you mean 'noise'"),
    "negative noise": ('"2 %"', '"-2 %"', "zero or more"),
    **{
        f"[discrepancy] {line}": ("[noise]", f"[discrepancy]\n{line}\n[noise]", said)
        for line, said in {
            'slip = "2 %"': "unknown key 'slip'",
            'torque = "2 %"': "did you mean 'torque_Nm'",
            'torque_Nm = "small"': "'2 %' of the readings' range",
            "torque_Nm = -1": "zero or more",
            "slip_length = 0.2": "no channel has a discrepancy",
            "torque_Nm = 1.0\nslip_length = 0": "slip_length is 0; it must lie",
        }.items()
    },
    "no TOML": ("[gear]", "[gear", "not valid TOML"),
    "unknown effect": ("[noise]", f"{EXITS.replace('exit-angle', 'sinking')}[noise]", "grousers"),
    "effect twice": ("[noise]", f"{EXITS}{EXITS}[noise]", "already"),
}


@pytest.mark.parametrize("what", MISTAKES)
def test_mistakes_are_named_with_their_place(tmp_path, what):
    old, new, said = MISTAKES[what]
    assert old in MODEL
    with pytest.raises(InputError) as caught:
        read_case(written(tmp_path, MODEL.replace(old, new, 1)))
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


EFFECTS = """\
[[effect]]
name = "slip-sinkage"
n1 = 0.3712345678901234
by_slip = -1.2345678901234
by_load = 0.1
[effect.prior]
n1 = [0.0, 1.0]
[[effect]]
name = "torque-offset"
offset = 1e-05
"""


@pytest.mark.parametrize(
    "text",
    [
        MODEL + EFFECTS,
        MODEL.replace('"wheel"', '"linear-wheel"'),
        MODEL.replace("cohesion = [0.0, 3000.0]", 'kphi = { range = [1e5, 1e7], scale = "log" }'),
        MODEL.replace('"2 %"', "0.05"),
    ],
)
def test_a_case_that_was_written_is_read_again_to_the_last_digit(tmp_path, text):
    case = read_case(written(tmp_path, text))
    again = read_case(written(tmp_path, case_as_toml(case, ["a comment", "another one"])))
    assert again == case and case_as_toml(again) == case_as_toml(case)
