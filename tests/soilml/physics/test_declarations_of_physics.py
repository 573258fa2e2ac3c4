"""What the classes of the room declare: bounds, defaults, cards, and that values do not change."""

import csv
import inspect
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from soilml import EFFECTS, Midstance, Operating, Track, Wheel, soil
from soilml.errors import InputError
from soilml.parameters import check, declared
from soilml.physics.effects.base import KINDS
from soilml.physics.gears import GEARS
from soilml.physics.gears.rigid_wheel import WheelArc
from soilml.physics.operating_point import COVARIATES
from soilml.physics.sinkage_estimate import SinkageEstimate

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


@pytest.mark.parametrize("row", PUBLISHED, ids=lambda row: f"{row['class']}.{row['field']}")
def test_a_parameter_is_accepted_up_to_its_bounds_and_no_further(row):
    node, field = DECLARING[row["class"], row["field"]], row["field"]
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


@pytest.mark.parametrize("name", EFFECTS)
def test_a_card_names_a_size_within_bounds_and_signs(name):
    card, parameters = EFFECTS[name].about, declared(EFFECTS[name])
    assert set(card.signs.values()) <= {-1, 1}
    assert set(card.signs) <= {"torque", "drawbar_pull", "sinkage"}
    for field, size in card.reference.items():
        assert parameters[field].lower <= size <= parameters[field].upper
    assert (card.calibration is None) == (card.kind not in ("rig", "sensor"))
    assert card.kind in KINDS and all(len(t) > 5 for t in (card.text, card.source, card.isolate))
    assert bool(card.varied_dimension) <= bool(card.varied)
    assert set(card.needs) <= set(COVARIATES)
    if card.calibration is not None:
        # a fault that a checked setup still has is not larger than one that matters
        assert 0.0 < card.calibration <= abs(card.reference[card.size])


def test_effects_of_running_gear_are_for_their_gear():
    """What a card says of wheels and tracks is what `applies_to` says."""
    wheel, track = Wheel(radius=0.1, width=0.1), Track(radius=0.1, width=0.08, base=0.6)
    by_gear = {
        "track-grousers": (False, True),
        "grousers": (True, False),
        "wheel-flexibility": (True, False),
        "torque-gain": (True, True),
    }
    for name, expected in by_gear.items():
        assert tuple(EFFECTS[name].applies_to(gear) for gear in (wheel, track)) == expected
    varied = {name: e.about.varied_dimension for name, e in EFFECTS.items() if e.about.varied}
    assert varied["small-wheel-stiffness"] == "radius"


def test_what_is_not_given_changes_nothing():
    one = np.ones(1)
    assert not SinkageEstimate(one, one).nearest
    rim = WheelArc(one, 0 * one, 0.5 * one, one, 0.1, 0.1, 0.1, 0.1)
    assert rim.travelled(np.asarray([0.25]), "displacement-sign") == pytest.approx(0.75)
    assert Wheel(radius=0.1, width=0.1).braking == "displacement-sign"
