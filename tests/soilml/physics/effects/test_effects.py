"""One contract for every effect of the catalogue."""

import inspect
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from conftest import input_box, solved

from soilml import EFFECTS, GEARS, Model, Operating, Status, Track, Wheel, soil
from soilml.errors import InputError
from soilml.parameters import check, declared
from soilml.physics.effects.base import KINDS, STAGES, Effect, SlipLoadScaling
from soilml.physics.forces import apply_input_effects
from soilml.physics.gears.rigid_wheel import RigidWheel
from soilml.physics.load_case import LoadCase
from soilml.physics.operating_point import COVARIATES

SAND = soil("wong1989/dry_sand")
WHEEL = Model(Wheel(radius=0.15, width=0.12))
KNOWN = {
    "speed": 0.1,
    "pass_number": 2.0,
    "slip_angle": 0.15,
    "progress": 0.8,
    "load_direction": 1.0,
}
AT = Operating(slip=np.linspace(0.15, 0.7, 8), load=60.0, **KNOWN)
PUBLISHED = Path(__file__).parents[1] / "declared_parameters.csv"
CHANNELS = ("torque", "drawbar_pull", "sinkage")
FORCES = ("load", "torque", "drawbar_pull", "sinkage", "entry_angle", "status")

OF_WHEELS = [name for name, effect in EFFECTS.items() if effect.applies_to(WHEEL.gear)]
#: With every rigid wheel that the effect applies to.
on_every_wheel = pytest.mark.parametrize(
    ("name", "gear"),
    [
        (name, gear)
        for name in OF_WHEELS
        for gear, cls in GEARS.items()
        if issubclass(cls, RigidWheel) and EFFECTS[name].applies_to(cls(radius=0.15, width=0.12))
    ],
)
every = pytest.mark.parametrize("name", OF_WHEELS)
TRACK = Model(Track(radius=0.1, width=0.08, base=0.6))
#: Those of tracks alone are tried on a track.
on_its_gear = pytest.mark.parametrize("name", EFFECTS)
shaped = pytest.mark.parametrize(
    "name", [n for n in OF_WHEELS if issubclass(EFFECTS[n], SlipLoadScaling)]
)
needy = pytest.mark.parametrize("name", [n for n, c in EFFECTS.items() if c.about.needs])


def sized(name, share=1.0, **more):
    """The effect at a share of its reference size, or at the bound of it."""
    cls = EFFECTS[name]
    bounds = declared(cls)
    sizes = {k: min(share * v, bounds[k].upper) for k, v in cls.about.reference.items()}
    return cls(**sizes, **more)


def known_to(count):
    """Speeds forward and back, passes and slip angles for rows of a box."""
    rows = np.arange(count)
    return {
        "speed": np.where(rows % 3, 1.0, -1.0) * 10.0 ** (-3 + 4 * (rows % 17) / 16),
        "pass_number": 1.0 + rows % 6,
        "slip_angle": -1.5 + 3.0 * (rows % 29) / 28,
        "progress": (rows % 11) / 10,
        "load_direction": 1.0 - rows % 3,
    }


@cache
def plain(gear):
    return solved(input_box(128, seed=4), gear=GEARS[gear], **known_to(128))


@pytest.mark.slow
@on_every_wheel
def test_neutral_changes_nothing_to_the_last_bit(name, gear):
    box = input_box(128, seed=4)
    assert (box["slip"] < 0).any() and (box["slip"] > 0).any()
    neutral = solved(box, [EFFECTS[name]()], GEARS[gear], **known_to(128))
    for field in FORCES:
        assert getattr(neutral, field).tobytes() == getattr(plain(gear), field).tobytes(), field


@pytest.mark.slow
@on_every_wheel
def test_finite_over_the_whole_box_or_flagged(name, gear):
    box, known = input_box(256, seed=8), known_to(256)
    for share in (0.5, 2.0):
        effect = sized(name, share)
        force = solved(box, [effect], GEARS[gear], **known)
        ok = force.status == Status.OK
        assert ok.mean() > 0.3
        for channel in CHANNELS:
            assert np.isfinite(getattr(force, channel)[ok]).all()
            assert np.isnan(getattr(force, channel)[~ok]).all()
        at = Operating(slip=box["slip"], load=box["load"], **known)
        true = apply_input_effects(LoadCase(Wheel(radius=0.1, width=0.1), SAND, at, (effect,))).at
        np.testing.assert_allclose(force.load[ok], true.load[ok], rtol=1e-6)
        assert (np.abs(true.slip) < 1).all() and (true.load > 0).all()


@pytest.mark.slow
@pytest.mark.parametrize("name", [n for n, e in EFFECTS.items() if e.applies_to(TRACK.gear)])
def test_a_track_is_left_alone_or_answered_or_flagged(name):
    slip, load = (part.ravel() for part in np.meshgrid([-0.6, -0.1, 0.1, 0.7], [40.0, 400.0, 4e4]))
    at = Operating(slip=slip, load=load, **known_to(slip.size))
    before, neutral = TRACK(SAND, at), (TRACK + EFFECTS[name]())(SAND, at)
    for field in FORCES:
        assert getattr(neutral, field).tobytes() == getattr(before, field).tobytes(), field
    force = (TRACK + sized(name))(SAND, at)
    ok = force.status == Status.OK
    assert ok.sum() >= 4
    for channel in CHANNELS:
        np.testing.assert_array_equal(np.isfinite(getattr(force, channel)), ok)
    changed = [np.abs(getattr(force, c) - getattr(before, c))[ok] > 1e-9 for c in CHANNELS]
    assert np.any(changed)


@pytest.mark.slow
@every
def test_any_size_within_its_bounds_is_answered_or_flagged(name):
    box, known = input_box(64, seed=6), known_to(64)
    size = EFFECTS[name].about.size
    bounds = declared(EFFECTS[name])[size]
    for value in (bounds.lower, bounds.upper):
        force = solved(box, [EFFECTS[name](**{size: value})], **known)
        ok = force.status == Status.OK
        for channel in CHANNELS:
            np.testing.assert_array_equal(np.isfinite(getattr(force, channel)), ok)


@on_its_gear
def test_signs_are_as_declared(name):
    effect, model = sized(name), WHEEL if name in OF_WHEELS else TRACK
    before, changed = model(SAND, AT), (model + effect)(SAND, AT)
    for channel, sign in effect.about.signs.items():
        assert (sign * (getattr(changed, channel) - getattr(before, channel)) > 0).all()
    assert any((getattr(changed, c) != getattr(before, c)).all() for c in CHANNELS)


@on_its_gear
def test_answers_change_smoothly_with_the_size(name):
    model = WHEEL if name in OF_WHEELS else TRACK

    def at_size(share):
        force = (model + sized(name, share))(SAND, AT)
        return np.stack([getattr(force, c) for c in CHANNELS])

    h = 1e-4
    coarse = (at_size(0.9 + 10 * h) - at_size(0.9 - 10 * h)) / (20 * h)
    fine = (at_size(0.9 + h) - at_size(0.9 - h)) / (2 * h)
    scale = np.abs(fine).max(axis=1, keepdims=True) + 1e-12
    assert np.abs((coarse - fine) / scale).max() < 1e-4


@pytest.mark.parametrize("name", EFFECTS)
def test_is_described(name):
    cls = EFFECTS[name]
    card, parameters = cls.about, declared(cls)
    assert cls.name == name
    assert issubclass(cls, Effect) and any(cls.overrides(stage) for stage in STAGES)
    assert "References:" in cls.__doc__ and ".. math::" in cls.__doc__
    assert card.kind in KINDS
    assert issubclass(cls, SlipLoadScaling) == (card.kind in ("soil", "wheel"))
    assert (card.calibration is not None) == (card.kind in ("rig", "sensor"))
    assert card.size == next(iter(parameters if card.kind in ("rig", "sensor") else card.reference))
    assert card.reference[card.size] != 0 and getattr(cls(), card.size) == 0
    assert set(card.reference) <= set(parameters)
    assert {*card.needs, *card.uses} <= set(COVARIATES)
    assert all(len(text) > 5 for text in (card.text, card.source, card.isolate))
    assert set(card.signs.values()) <= {-1, 1} and set(card.signs) <= set(CHANNELS)
    assert all(
        parameters[k].lower <= size <= parameters[k].upper for k, size in card.reference.items()
    )
    assert bool(card.varied_dimension) <= bool(card.varied)
    # a fault that a checked setup still has is not larger than one that matters
    assert card.calibration is None or 0.0 < card.calibration <= abs(card.reference[card.size])
    check(cls())
    check(sized(name))


@pytest.mark.parametrize("name", EFFECTS)
def test_is_computed_by_hand(name):
    by_hand = Path(__file__).with_name("test_effects_by_hand.py")
    assert f'"{name}"' in by_hand.read_text(), (
        f"no test computes {name} by hand. Write one in tests/soilml/physics/effects/{by_hand.name}"
        f" with EFFECTS[{name!r}](...): what the equation in the docstring of"
        f" {EFFECTS[name].__name__} gives at one operating point, in numbers of the test's own"
    )


@pytest.mark.parametrize("name", EFFECTS)
def test_its_parameters_are_published(name):
    cls, rows = EFFECTS[name], PUBLISHED.read_text().splitlines()
    lacking = [
        f"{cls.__name__},{key},{own.unit},{own.lower},{own.upper},{getattr(cls(), key)}"
        for key, own in declared(cls).items()
        if key in inspect.get_annotations(cls)
        and not any(row.startswith(f"{cls.__name__},{key},") for row in rows)
    ]
    assert not lacking, (
        "files of users rely on units, bounds and defaults of parameters. Add to "
        f"tests/soilml/physics/{PUBLISHED.name}, in the order of the alphabet:\n"
        + "\n".join(lacking)
    )


@needy
def test_what_nobody_measured_is_asked_for_by_its_column(name):
    (need,) = EFFECTS[name].about.needs
    for effect in (EFFECTS[name](), sized(name)):
        with pytest.raises(InputError) as caught:
            (WHEEL + effect)(SAND, replace(AT, **{need: None}))
        assert str(caught.value) == f"the effect {name} needs the column {COVARIATES[need]}"


@shaped
@pytest.mark.parametrize("slip, load", [(0.3, 100.0), (0.5, 40.0), (-0.2, 130.0)])
def test_the_size_runs_with_slip_and_load_as_written(name, slip, load):
    at = replace(AT, slip=slip, load=load)
    growth = ((abs(slip) + 0.03) / 0.33) ** 0.6 * (load / 100.0) ** 0.2
    growth *= np.exp(0.7 * (abs(slip) - 0.3))
    laws = {"slip_power": 0.6, "by_load": 0.2, "by_slip": 0.7}
    running = (WHEEL + sized(name, 0.8, **laws))(SAND, at)
    size = EFFECTS[name].about.size
    scaled = {size: growth * getattr(sized(name, 0.8), size)}
    fixed = (WHEEL + replace(sized(name, 0.8), **scaled))(SAND, at)
    for channel in CHANNELS:
        np.testing.assert_allclose(
            getattr(running, channel), getattr(fixed, channel), rtol=1e-9, atol=1e-12
        )


@every
def test_a_row_is_answered_alike_alone_and_among_others(name):
    slips = np.asarray([-0.3, -0.004, 0.004, 0.012, 0.2, 0.6])
    model = WHEEL + sized(name, -1.0 if name == "slip-scale" else 1.0)
    together = model(SAND, replace(AT, slip=slips))
    for i, slip in enumerate(slips):
        alone = model(SAND, replace(AT, slip=slip))
        for channel in CHANNELS:
            np.testing.assert_allclose(
                getattr(together, channel)[i], getattr(alone, channel), rtol=1e-10
            )


def test_the_two_forms_of_the_exit_angle_exclude_each_other():
    exit_angle = EFFECTS["exit-angle"]
    with pytest.raises(InputError, match="kappa or b0"):
        exit_angle(kappa=0.1, b0=-0.1)
    with pytest.raises(InputError, match="kappa or b0"):
        exit_angle(kappa=np.asarray([0.0, 0.2]), b0=np.asarray([0.0, -0.1]))
    exit_angle(kappa=np.asarray([0.0, 0.2]), b0=np.asarray([-0.1, 0.0]))
