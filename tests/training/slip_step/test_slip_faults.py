"""The slip filter under wild readings, and files and states in which bits have flipped."""

from dataclasses import replace

import numpy as np
import pytest
from bit_flips import flip_bits, flipped
from slip_step_fixtures import DrivenInC, slip_row

from soilml.errors import InputError
from soilml.onboard.slip_stream import FLAGS

#: Readings that no rover has, by the name of the argument.
IMPOSSIBLE = [
    ("rim_speed", 1e20),
    ("rim_speed", -1e20),
    ("load", 1e20),
    ("load", -1.0),
    ("slope", 1e20),
    ("elapsed", 1e20),
    ("elapsed", 0.0),
]


@pytest.mark.parametrize(("name", "value"), IMPOSSIBLE)
def test_what_is_not_possible_is_refused_and_the_state_goes_on(
    name, value, slip_stream, slip_drive
):
    _, state = slip_stream.step(slip_stream.start(), **slip_row(slip_drive, 45))
    before = state.grounds.copy()
    with pytest.raises(InputError, match=f"{name} is .*; possible is"):
        slip_stream.step(state, **slip_row(slip_drive, 46, **{name: value}))
    assert np.array_equal(state.grounds, before)
    found, _ = slip_stream.step(state, **slip_row(slip_drive, 46))
    assert found.answered and np.isfinite(found.speed)


def test_a_state_in_which_a_bit_has_flipped_is_refused(slip_stream, slip_drive):
    _, state = slip_stream.step(slip_stream.start(), **slip_row(slip_drive, 45))
    rng, row = np.random.default_rng(0), slip_row(slip_drive, 46)
    for k in range(300):
        part = "recent" if k % 3 == 0 else "grounds"
        bad = flipped(getattr(state, part), rng)
        with pytest.raises(InputError, match="this state is damaged: its checksum does not match"):
            slip_stream.step(replace(state, **{part: bad}), **row)
    assert slip_stream.step(state, **row)[0].answered


@pytest.mark.slow
def test_c_goes_on_after_wild_readings(slip_in_c, slip_drive, slip_stream):
    own, state = DrivenInC(slip_in_c), slip_stream.start()
    for i in range(45, 50):
        row = slip_row(slip_drive, i, **({"torque": 1e20} if i == 46 else {}))
        for name, value in IMPOSSIBLE:
            before = bytes(own.state)
            code, _ = own.step(slip_row(slip_drive, i, **{name: value}))
            assert code == slip_in_c.codes["BAD_READING"] and bytes(own.state) == before
        code, answer = own.step(row)
        found, state = slip_stream.step(state, **row)
        assert code >= 0 and answer.speed == pytest.approx(found.speed, abs=1e-4)
        assert answer.flags == sum(1 << FLAGS.index(name) for name in found.flags)
    assert np.isfinite(own.state.grounds[:]).all()


@pytest.mark.slow
def test_c_refuses_a_state_in_which_a_bit_has_flipped(slip_in_c, slip_drive):
    own, rng = DrivenInC(slip_in_c), np.random.default_rng(2)
    own.step(slip_row(slip_drive, 45))
    row = slip_row(slip_drive, 46)
    for bad in flip_bits(own.state, 1000, rng):
        assert own.step(row)[0] == slip_in_c.codes["NOT_STARTED"] and bytes(own.state) == bad
    assert own.step(row)[0] >= 0
    own.state = slip_in_c.new("state")
    assert own.step(row)[0] == slip_in_c.codes["NOT_STARTED"]
