"""One contract for every effect of the catalogue."""

import inspect
from dataclasses import replace
from functools import cache
from itertools import product
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
TRACK = Model(Track(radius=0.1, width=0.08, base=0.6))


def wheels(name):
    """Types of rigid wheels that an effect suits."""
    rigid = (gear for gear, cls in GEARS.items() if issubclass(cls, RigidWheel))
    return [gear for gear in rigid if EFFECTS[name].applies_to(GEARS[gear](radius=0.15, width=0.1))]


def model_of(name):
    """A wheel, or a track for an effect of tracks alone."""
    return WHEEL if name in OF_WHEELS else TRACK


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
    return solved(input_box(64, seed=4), gear=GEARS[gear], **known_to(64))


def is_described(name):
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


def is_computed_by_hand(name):
    by_hand = Path(__file__).with_name("test_effects_by_hand.py")
    assert f'"{name}"' in by_hand.read_text(), (
        f"no test computes {name} by hand. Write one in tests/soilml/physics/effects/{by_hand.name}"
        f" with EFFECTS[{name!r}](...): what the equation in the docstring of"
        f" {EFFECTS[name].__name__} gives at one operating point, in numbers of the test's own"
    )


def has_published_parameters(name):
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


def has_the_declared_signs(name):
    effect, model = sized(name), model_of(name)
    before, changed = model(SAND, AT), (model + effect)(SAND, AT)
    for channel, sign in effect.about.signs.items():
        assert (sign * (getattr(changed, channel) - getattr(before, channel)) > 0).all()
    assert any((getattr(changed, c) != getattr(before, c)).all() for c in CHANNELS)


def changes_smoothly_with_its_size(name):
    def at_size(share):
        force = (model_of(name) + sized(name, share))(SAND, AT)
        return np.stack([getattr(force, c) for c in CHANNELS])

    h = 1e-4
    coarse = (at_size(0.9 + 10 * h) - at_size(0.9 - 10 * h)) / (20 * h)
    fine = (at_size(0.9 + h) - at_size(0.9 - h)) / (2 * h)
    scale = np.abs(fine).max(axis=1, keepdims=True) + 1e-12
    assert np.abs((coarse - fine) / scale).max() < 1e-4


def asks_for_its_column(name):
    for need in EFFECTS[name].about.needs:
        for effect in (EFFECTS[name](), sized(name)):
            with pytest.raises(InputError) as caught:
                (WHEEL + effect)(SAND, replace(AT, **{need: None}))
            assert str(caught.value) == f"the effect {name} needs the column {COVARIATES[need]}"


def runs_with_slip_and_load_as_written(name):
    if name not in OF_WHEELS or not issubclass(EFFECTS[name], SlipLoadScaling):
        return
    slip, load = np.asarray([0.3, 0.5, -0.2]), np.asarray([100.0, 40.0, 130.0])
    at = replace(AT, slip=slip, load=load)
    growth = ((np.abs(slip) + 0.03) / 0.33) ** 0.6 * (load / 100.0) ** 0.2
    growth *= np.exp(0.7 * (np.abs(slip) - 0.3))
    laws = {"slip_power": 0.6, "by_load": 0.2, "by_slip": 0.7}
    running = (WHEEL + sized(name, 0.8, **laws))(SAND, at)
    size = EFFECTS[name].about.size
    scaled = {size: growth * getattr(sized(name, 0.8), size)}
    fixed = (WHEEL + replace(sized(name, 0.8), **scaled))(SAND, at)
    for channel in CHANNELS:
        np.testing.assert_allclose(
            getattr(running, channel), getattr(fixed, channel), rtol=1e-9, atol=1e-12
        )


def answers_a_row_alike_alone_and_among_others(name):
    slips = np.asarray([-0.3, -0.004, 0.004, 0.012, 0.2, 0.6])
    model = model_of(name) + sized(name, -1.0 if name == "slip-scale" else 1.0)
    together = model(SAND, replace(AT, slip=slips))
    for i, slip in enumerate(slips):
        alone = model(SAND, replace(AT, slip=slip))
        for channel in CHANNELS:
            np.testing.assert_allclose(
                getattr(together, channel)[i], getattr(alone, channel), rtol=1e-10
            )


def is_neutral_by_default_to_the_last_bit(name):
    box = input_box(64, seed=4)
    assert (box["slip"] < 0).any() and (box["slip"] > 0).any()
    for gear in wheels(name):
        neutral = solved(box, [EFFECTS[name]()], GEARS[gear], **known_to(64))
        for field in FORCES:
            assert getattr(neutral, field).tobytes() == getattr(plain(gear), field).tobytes(), field


def is_finite_over_the_whole_box_or_flagged(name):
    box, known = input_box(128, seed=8), known_to(128)
    for gear, share in product(wheels(name), (0.5, 2.0)):
        effect = sized(name, share)
        force = solved(box, [effect], GEARS[gear], **known)
        assert answered_or_flagged(force).mean() > 0.3
        ok = force.status == Status.OK
        at = Operating(slip=box["slip"], load=box["load"], **known)
        true = apply_input_effects(LoadCase(Wheel(radius=0.1, width=0.1), SAND, at, (effect,))).at
        np.testing.assert_allclose(force.load[ok], true.load[ok], rtol=1e-6)
        assert (np.abs(true.slip) < 1).all() and (true.load > 0).all()


def answered_or_flagged(force):
    """Which rows have a number in every channel; the others have none, and a status."""
    ok = force.status == Status.OK
    for channel in CHANNELS:
        np.testing.assert_array_equal(np.isfinite(getattr(force, channel)), ok)
    return ok


def leaves_a_track_alone_or_is_answered_or_flagged(name):
    if not EFFECTS[name].applies_to(TRACK.gear):
        return
    slip, load = (part.ravel() for part in np.meshgrid([-0.6, -0.1, 0.1, 0.7], [40.0, 400.0, 4e4]))
    at = Operating(slip=slip, load=load, **known_to(slip.size))
    before, neutral = TRACK(SAND, at), (TRACK + EFFECTS[name]())(SAND, at)
    for field in FORCES:
        assert getattr(neutral, field).tobytes() == getattr(before, field).tobytes(), field
    force = (TRACK + sized(name))(SAND, at)
    ok = answered_or_flagged(force)
    assert ok.sum() >= 4
    assert np.any([np.abs(getattr(force, c) - getattr(before, c))[ok] > 1e-9 for c in CHANNELS])


def is_answered_or_flagged_at_the_bounds_of_its_size(name):
    if name in OF_WHEELS:
        size = EFFECTS[name].about.size
        bounds = declared(EFFECTS[name])[size]
        for value in (bounds.lower, bounds.upper):
            effect = EFFECTS[name](**{size: value})
            answered_or_flagged(solved(input_box(64, seed=6), [effect], **known_to(64)))


#: Properties of every effect, and those that take a tenth of a second.
QUICK = (
    is_described, is_computed_by_hand, has_published_parameters, has_the_declared_signs,
    changes_smoothly_with_its_size, asks_for_its_column, runs_with_slip_and_load_as_written,
    answers_a_row_alike_alone_and_among_others,
)  # fmt: skip
SLOW = (
    is_neutral_by_default_to_the_last_bit, is_finite_over_the_whole_box_or_flagged,
    leaves_a_track_alone_or_is_answered_or_flagged,
    is_answered_or_flagged_at_the_bounds_of_its_size,
)  # fmt: skip


@pytest.mark.parametrize("name", EFFECTS)
def test_the_contract_of_effects(name, subtests):
    for holds in QUICK:
        with subtests.test(holds.__name__):
            holds(name)


@pytest.mark.slow
@pytest.mark.parametrize("name", EFFECTS)
def test_an_effect_is_neutral_by_default_and_finite_or_flagged(name, subtests):
    for holds in SLOW:
        with subtests.test(holds.__name__):
            holds(name)


def test_the_two_forms_of_the_exit_angle_exclude_each_other():
    exit_angle = EFFECTS["exit-angle"]
    with pytest.raises(InputError, match="kappa or b0"):
        exit_angle(kappa=0.1, b0=-0.1)
    with pytest.raises(InputError, match="kappa or b0"):
        exit_angle(kappa=np.asarray([0.0, 0.2]), b0=np.asarray([0.0, -0.1]))
    exit_angle(kappa=np.asarray([0.0, 0.2]), b0=np.asarray([-0.1, 0.0]))
