"""A user's own effects, from a file of theirs."""

import numpy as np
import pytest

from soilml import Model, Operating, Wheel, soil
from soilml.errors import InputError
from soilml.physics.user_effects import load_effects

OWN = '''\
from __future__ import annotations

from dataclasses import replace
from typing import Annotated

from soilml import Effect, effect
from soilml.arrays import Real
from soilml.parameters import Parameter


@effect(
    "crust",
    text="a crust carries a part of the load",
    source="own",
    kind="soil",
    reference={"strength": 5.0},
    signs={"sinkage": -1},
    isolate="the same runs on raked soil",
)
class Crust(Effect):
    """A crust carries a part of the load."""

    strength: Annotated[Real, Parameter("N", 0.0, 50.0, "load that it carries")] = 0.0

    def on_force(self, force, scene):
        return replace(force, load=force.load + self.strength)
'''
SAND = soil("wong1989/dry_sand")
WHEEL = Model(Wheel(radius=0.15, width=0.12))


@pytest.fixture
def own(tmp_path):
    path = tmp_path / "my-effects.py"
    path.write_text(OWN)
    return path


def test_an_effect_of_ones_own_acts_as_those_of_the_catalogue(own):
    (crust,) = load_effects(own).values()
    at = Operating(slip=np.asarray([0.2, 0.5]), load=60.0)
    found = (WHEEL + crust(strength=5.0))(SAND, at)
    lighter = WHEEL(SAND, Operating(slip=at.slip, load=55.0))
    np.testing.assert_allclose(found.sinkage, lighter.sinkage, rtol=1e-7)
    np.testing.assert_array_equal((WHEEL + crust())(SAND, at).torque, WHEEL(SAND, at).torque)
    with pytest.raises(InputError, match=r"crust\.strength is 70 N"):
        (WHEEL + crust(strength=70.0))(SAND, at)


def test_a_changed_file_is_read_again_and_nothing_is_left_beside_it(own):
    load_effects(own)
    own.write_text(OWN.replace('"crust"', '"crusu"'))  # as long, within the same second
    assert list(load_effects(own)) == ["crusu"]
    assert [path.name for path in own.parent.iterdir()] == ["my-effects.py"]


def test_the_text_is_by_default_the_first_line_of_the_docstring(own):
    with_text = OWN.replace('    text="a crust carries a part of the load",\n', "")
    for doc in ('"""A crust carries', '"""\n    A crust carries'):
        own.write_text(with_text.replace('"""A crust carries', doc))
        assert load_effects(own)["crust"].about.text == "a crust carries a part of the load"


DECLARED = OWN[OWN.index("@effect") : OWN.index("class Crust")]


@pytest.mark.parametrize(
    "old, new, said",
    [
        (OWN, "x = 1\n", "no effect in it; one is a class under @effect(NAME, ...) with one of"),
        (OWN, "", "no effect in it"),
        ("replace(force", "replace((force", "line "),
        ("import annotations", "import annotation", "line 1: future feature annotation"),
        (OWN, "x = 1 / 0\n", "ZeroDivisionError when run: division by zero"),
        (OWN, "import soilml.nonsense\n", "ModuleNotFoundError when run"),
        (OWN, "raise SystemExit('no')\n", "SystemExit when run: no"),
        (OWN, "raise ValueError('two\\nlines')\n", "ValueError when run: two lines"),
        ('"crust"', '"grousers"', "Crust: the catalogue has an effect 'grousers' already"),
        ('    source="own",\n', "", "TypeError when run: EffectCard.__init__() missing 1 required"),
        ('"crust"', '"my crust."', "Crust: name is 'my crust.'; it takes lower-case letters"),
        (DECLARED, "", "Crust: declare it: write @effect(NAME, ...) above the class"),
        ('{"strength": 5.0}', "{}", "Crust: reference is empty"),
        ('{"strength": 5.0}', '{"size": 1.0}', "has 'size'; its parameters are: strength"),
        ('{"strength": 5.0}', '{"strength": 99.0}', "reference strength is 99 N"),
        ("[Real, Parameter", "[Reel, Parameter", "types that exist and neutral defaults"),
        (" = 0.0\n", "\n", "Crust: its fields need types that exist and neutral defaults"),
        (" = 0.0\n", " = -1.0\n", "Crust: strength is -1 N"),
        (
            "on_force",
            "on_forces",
            "Crust: on_forces is not a stage of a model; did you mean on_force? ",
        ),
        ("on_force", "forces", "Crust: it acts on nothing; it needs one of the methods on_op"),
        ("class Crust(Effect):", "class Crust(Base):", "NameError when run"),
        ("class Crust(Effect):", "class Crust:", "Crust: derive it from soilml.Effect"),
        ('"soil"', '"water"', "kind is 'water'; there are: soil, wheel, rig, sensor"),
        (
            "    signs",
            "    needs=('moisture',),\n    signs",
            "needs or uses has 'moisture'",
        ),
    ],
)
def test_what_is_wrong_is_said_in_one_line(own, old, new, said):
    assert old in OWN
    own.write_text(OWN.replace(old, new))
    with pytest.raises(InputError) as caught:
        load_effects(own)
    text = str(caught.value)
    assert text.startswith(f"{own}: ") and said in text and "\n" not in text


def test_two_effects_of_one_name_are_refused(own):
    again = OWN[OWN.index("@effect") :].replace("class Crust", "class Second")
    own.write_text(OWN + "\n\n" + again)
    with pytest.raises(InputError, match="Second: Crust is 'crust' already"):
        load_effects(own)


def test_a_file_that_is_not_there_or_no_python_is_refused(own, tmp_path):
    with pytest.raises(InputError, match="no such file"):
        load_effects(tmp_path / "none.py")
    with pytest.raises(InputError, match="no such file"):
        load_effects(tmp_path)
    with pytest.raises(InputError, match=r"must end in \.py"):
        load_effects(own.rename(tmp_path / "effects.txt"))
    own.write_bytes(b"x = '\xff\x00'\n")
    with pytest.raises(InputError, match=r"my-effects\.py: "):
        load_effects(own)
