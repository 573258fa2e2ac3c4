"""The slip filter under wild readings, and files and states in which bits have flipped."""

import ctypes
from dataclasses import replace

import numpy as np
import pytest
from compiled_c import COMPILERS, CompiledModel, compile_library

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


def row_of(slip_drive, i, **changed):
    """A row of the drive; `changed` replaces one number, that of the first wheel."""
    row = {
        "rim_speed": slip_drive.rim_speed[i].copy(),
        "torque": slip_drive.torque[i].copy(),
        "load": slip_drive.load[i].copy(),
        "slope": float(slip_drive.slope[i]),
        "elapsed": 1.0,
    }
    for name, value in changed.items():
        if np.ndim(row[name]):
            row[name][0] = value
        else:
            row[name] = value
    return row


@pytest.fixture(scope="module")
def in_c(slip_files):
    """The C file, compiled."""
    if not COMPILERS:
        pytest.skip("no C compiler")
    library = compile_library(slip_files / "rover.c", slip_files / "faults.so", COMPILERS[0])
    return CompiledModel(slip_files / "rover.h", library)


class Driven:
    """A state of the C file along rows."""

    def __init__(self, model):
        self.model, self.state = model, model.new("state")
        model.call("start", self.state)

    def step(self, row):
        """Code and estimate."""
        own, answer = self.model.new("row"), self.model.new("estimate")
        for name, value in row.items():
            if np.ndim(value):
                getattr(own, name)[:] = value
            else:
                setattr(own, name, value)
        return self.model.call("step", self.state, own, answer, self.model.work), answer


@pytest.mark.parametrize(("name", "value"), IMPOSSIBLE)
def test_what_is_not_possible_is_refused_and_the_state_goes_on(
    name, value, slip_stream, slip_drive
):
    _, state = slip_stream.step(slip_stream.start(), **row_of(slip_drive, 45))
    before = state.grounds.copy()
    with pytest.raises(InputError, match=f"{name} is .*; possible is"):
        slip_stream.step(state, **row_of(slip_drive, 46, **{name: value}))
    assert np.array_equal(state.grounds, before)
    found, _ = slip_stream.step(state, **row_of(slip_drive, 46))
    assert found.answered and np.isfinite(found.speed)


def flipped(content, rng):
    """The bytes with one bit flipped."""
    found = bytearray(content)
    found[rng.integers(len(found))] ^= 1 << int(rng.integers(8))
    return bytes(found)


def test_a_state_in_which_a_bit_has_flipped_is_refused(slip_stream, slip_drive):
    _, state = slip_stream.step(slip_stream.start(), **row_of(slip_drive, 45))
    rng, row = np.random.default_rng(0), row_of(slip_drive, 46)
    for k in range(300):
        part = "recent" if k % 3 == 0 else "grounds"
        own = getattr(state, part)
        bad = np.frombuffer(flipped(own.tobytes(), rng), np.float32).reshape(own.shape)
        with pytest.raises(InputError, match="this state is damaged: its checksum does not match"):
            slip_stream.step(replace(state, **{part: bad}), **row)
    assert slip_stream.step(state, **row)[0].answered


@pytest.mark.slow
def test_c_goes_on_after_wild_readings(in_c, slip_drive, slip_stream):
    own, state = Driven(in_c), slip_stream.start()
    for i in range(45, 50):
        row = row_of(slip_drive, i, **({"torque": 1e20} if i == 46 else {}))
        for name, value in IMPOSSIBLE:
            before = bytes(own.state)
            code, _ = own.step(row_of(slip_drive, i, **{name: value}))
            assert code == in_c.codes["BAD_READING"] and bytes(own.state) == before
        code, answer = own.step(row)
        found, state = slip_stream.step(state, **row)
        assert code >= 0 and answer.speed == pytest.approx(found.speed, abs=1e-4)
        assert answer.flags == sum(1 << FLAGS.index(name) for name in found.flags)
    assert np.isfinite(own.state.grounds[:]).all()


@pytest.mark.slow
def test_c_refuses_a_state_in_which_a_bit_has_flipped(in_c, slip_drive):
    own, rng = Driven(in_c), np.random.default_rng(2)
    own.step(row_of(slip_drive, 45))
    sound, row = bytes(own.state), row_of(slip_drive, 46)
    for _ in range(1000):
        bad = flipped(sound, rng)
        ctypes.memmove(ctypes.byref(own.state), bad, len(bad))
        assert own.step(row)[0] == in_c.codes["NOT_STARTED"] and bytes(own.state) == bad
    ctypes.memmove(ctypes.byref(own.state), sound, len(sound))
    assert own.step(row)[0] >= 0
    own.state = in_c.new("state")
    assert own.step(row)[0] == in_c.codes["NOT_STARTED"]
