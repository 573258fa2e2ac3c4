"""Maps of what cannot be are refused."""

import numpy as np
import pytest
from described_rigs import WRITERS

from soilml.errors import InputError
from soilml.log_import import import_log, init_map

#: Wrong lines in place of right ones, for the log with a sensor on its side, and the code.
WRONG = {
    "a lateral force as load": ('"Force Y"', '"Force Z"', "pull-out-of-range"),
    "a moment as sinkage": (
        'column = "Vertical Axis Position"', 'column = "Torque X"', "unit-of-another-kind",
    ),
    "a torque in N cm": (
        'column = "Torque Z"\nunit = "Nm"', 'column = "Torque X"\nunit = "kN m"',
        "traction-out-of-range",
    ),
    "a sinkage in m": (
        'column = "Vertical Axis Position"\nunit = "mm"',
        'column = "Vertical Axis Position"\nscale = "1 m"', "sinkage-out-of-range",
    ),
}  # fmt: skip


def edited(text, old, new):
    lines = [line.split("  #")[0] for line in text.split("\n")]
    plain = "\n".join(lines)
    assert old in plain, plain
    return plain.replace(old, new)


@pytest.fixture(scope="module")
def on_its_side(tmp_path_factory):
    """The logs of a rig whose sensor lies on its side, and their guessed map."""
    logs, _ = WRITERS[0](np.random.default_rng(5), tmp_path_factory.mktemp("rig"))
    return logs, init_map(logs)


@pytest.mark.slow
@pytest.mark.parametrize("radius", [True, False])
@pytest.mark.parametrize("case", WRONG)
def test_what_cannot_be_is_refused(case, radius, on_its_side, tmp_path):
    old, new, code = WRONG[case]
    logs, guessed = on_its_side
    text = edited(guessed, old, new)
    if not radius:  # slip as it was set, and no radius
        text = text.replace('diameter = "26.0 cm +- 1 %"', "").replace("[position]", "[wheel_x]")
        start, stop = text.index("[wheel_angle]"), text.index("[torque]")
        text = text[:start] + "[slip]\nvalue = 0.3\n\n" + text[stop:]
    (tmp_path / "map.toml").write_text(text)
    found = import_log(logs, tmp_path / "map.toml", accept=True)
    assert code in {remark.code for remark in found.implausible}
    if radius:
        with pytest.raises(InputError) as refused:
            import_log(logs, tmp_path / "map.toml")
        assert str(refused.value).startswith(found.implausible[0].text)


def test_a_load_that_is_not_of_the_mass_is_refused(on_its_side, tmp_path):
    logs, guessed = on_its_side
    for mass, wrong in ((14.0, False), (60.0, True)):
        text = guessed + f"\n[vehicle]\nmass = {mass}\n"
        (tmp_path / "map.toml").write_text(text)
        found = import_log(logs, tmp_path / "map.toml", accept=True)
        assert ("load-not-of-mass" in {r.code for r in found.implausible}) == wrong
