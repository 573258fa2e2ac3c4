"""What the classes of the room declare: bounds, defaults, cards, and that values do not change."""

import csv
import inspect
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from soilml import EFFECTS, Midstance, Operating, Track, soil
from soilml.errors import InputError
from soilml.parameters import check, declared
from soilml.physics.gears import GEARS

#: Bounds and defaults that files of users rely on: one that becomes narrower refuses files that
#: were valid, and another default changes what they mean.
PUBLISHED = list(
    csv.DictReader(Path(__file__).with_name("declared_parameters.csv").read_text().splitlines())
)
NODES = [
    soil("wong1989/dry_sand"),
    Operating(slip=0.2, load=60.0, speed=0.1, pass_number=2.0, slip_angle=0.1),
    *(cls(radius=0.15, width=0.12) for name, cls in GEARS.items() if "wheel" in name),
    Track(radius=0.1, width=0.08, base=0.6),
    Midstance(radius=0.15, width=0.03, arc=0.3, leg_length=0.18, tip_height=0.01),
    *(cls() for cls in EFFECTS.values()),
]
#: A node that has each parameter, by the class that declares it and the name of the field.
DECLARING = {
    (owner.__name__, field): node
    for node in reversed(NODES)
    for owner in type(node).__mro__
    for field in declared(type(node)).keys() & inspect.get_annotations(owner).keys()
}


def test_a_parameter_is_accepted_up_to_its_bounds_and_no_further(subtests):
    for row in PUBLISHED:
        node, field = DECLARING[row["class"], row["field"]], row["field"]
        with subtests.test(f"{row['class']}.{field}"):
            for end, outwards in (("lower", -np.inf), ("upper", np.inf)):
                bound = float(row[end])
                check(_with(node, field, bound))
                with pytest.raises(InputError, match=f"{field} is .*"):
                    check(_with(node, field, float(np.nextafter(bound, outwards))))
            default = next(f for f in fields(type(node)) if f.name == field).default
            assert default is None or isinstance(default, float) == bool(row["default"])
            assert declared(type(node))[field].unit == row["unit"]
            if row["default"]:
                assert default == float(row["default"])


def _with(node, field, value):
    """The node with one field replaced, without what `__post_init__` asks of several together."""
    changed = replace(node)
    object.__setattr__(changed, field, value)
    return changed
