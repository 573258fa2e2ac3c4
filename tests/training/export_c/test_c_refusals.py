"""What the C code refuses: by a code, and with the memory as it was."""

import ctypes

import numpy as np
import pytest

pytestmark = pytest.mark.slow

READING = {"slip": 0.3, "torque": 3.0, "load": 60.0}
BAD = [
    ({"slip": np.inf}, "BAD_READING"),
    ({"slip": 1.0}, "BAD_READING"),
    ({"slip": -1.0}, "BAD_READING"),
    ({"torque": np.inf}, "BAD_READING"),
    ({"torque": -np.inf}, "BAD_READING"),
    ({"load": 0.0}, "BAD_READING"),
    ({"load": -np.inf}, "BAD_READING"),
    ({"sinkage": np.inf}, "BAD_READING"),
    ({"drawbar_pull": -np.inf}, "BAD_READING"),
    ({"torque_std": 0.0}, "BAD_STD"),
    ({"torque_std": np.inf}, "BAD_STD"),
    ({"torque_bias": -1.0}, "BAD_STD"),
    ({"sinkage": 0.02, "sinkage_std": -0.001}, "BAD_STD"),
]


@pytest.fixture
def wheel(compiled):
    return compiled("wheel")


@pytest.fixture
def memory(wheel):
    """A memory of three rows."""
    made = wheel.start()
    rows = wheel.rows(slip=[0.1, 0.3, 0.5], torque=[1.5, 3.0, 3.6], load=[60.0] * 3)
    assert wheel.step(made, rows)[0] == 0
    return made


@pytest.mark.parametrize(("change", "code"), BAD)
def test_a_bad_row_changes_nothing(change, code, wheel, memory):
    before = bytes(memory)
    row = READING | change
    rows = (wheel.structs["wheel_row"] * 2)(wheel.row(**READING), wheel.row(**row))
    assert wheel.step(memory, rows)[0] == wheel.codes[code] < 0
    assert bytes(memory) == before
    if set(change) <= set(READING):
        assert wheel.single(wheel.row(**row))[0] == wheel.codes[code]


def test_a_bad_number_of_rows_changes_nothing(wheel, memory):
    before = bytes(memory)
    rows = wheel.rows(**{k: [v] * 33 for k, v in READING.items()})
    for count in (-1, 0, 33):
        code = wheel.call("set_step", memory, rows, count, None, None, wheel.work)
        assert code == wheel.codes["BAD_COUNT"]
    assert bytes(memory) == before


def test_numbers_beyond_float_change_nothing(wheel, memory):
    before = bytes(memory)
    row = wheel.row(**READING, torque_bias=3e38, torque_std=1e-30)
    code, _ = wheel.step(memory, (type(row) * 1)(row))
    assert code in (wheel.codes["NOT_FINITE"], wheel.codes["OK"])
    assert bytes(memory) == before or np.isfinite(memory.factor[:]).all()


def test_the_memory_of_another_file_is_refused(wheel, compiled):
    other = compiled("kls1_wheel")
    memory = ctypes.cast(
        ctypes.pointer(other.start()), ctypes.POINTER(wheel.structs["wheel_memory"])
    )
    assert wheel.answer(memory.contents)[0] == wheel.codes["NOT_STARTED"]


def test_rows_out_of_range_are_set_aside_and_end_in_the_prior_where_they_are_most(wheel, memory):
    before = list(memory.factor)
    rows = wheel.rows(slip=[0.7, 0.3], torque=[3.0, 3.0], load=[60.0, 500.0])
    assert wheel.step(memory, rows) == (0, [False, False])
    assert list(memory.factor) == before and list(memory.counted) == [3.0, 5.0, 3.0]
    assert wheel.answer(memory)[0] == 0  # two of five rows are set aside
    assert wheel.step(memory, rows) == (0, [False, False])
    code, answer = wheel.answer(memory)  # four of seven are more than half
    assert code == wheel.codes["OUT_OF_RANGE"] and not answer["in_range"]
    assert answer["abstains"].all()
