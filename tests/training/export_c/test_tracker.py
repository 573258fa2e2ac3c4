"""The tracker in C against `SoilTracker`: the same events, and the same estimates."""

import ctypes
import sys
from pathlib import Path

import numpy as np
import pytest
from bit_flips import flip_bits
from compiled_c import COMPILERS, ROOT, CompiledModel, as_arrays, compile_library
from simulated_rows import ANY_WHEEL

sys.path.insert(0, str(Path(__file__).parents[3] / "bench"))

from driven_days import SLIP_STD, simulate_day

from soilml import Estimator, SoilTracker
from soilml.cli import main
from soilml.onboard.tracking import Event

pytestmark = pytest.mark.slow
#: Largest difference of mean and standard deviation, in standard deviations, of one row of a
#: hundred and of any: sums in another order, and a factor in the place of singular vectors.
OFTEN, WORST = 1e-3, 0.02


class CompiledTracker:
    """A tracker of a compiled model."""

    def __init__(self, model, context):
        self.model = model
        self.tracker, self.estimate = model.new("tracker"), model.new("set_estimate")
        given = model.new("context", **context) if context else None
        assert model.call("tracker_start", self.tracker, given) == 0

    def read(self, **row):
        """Code, event and estimate."""
        event = (ctypes.c_int * 1)(-1)
        row = self.model.row(**row)
        arguments = self.tracker, row, event, self.estimate, self.model.work
        return self.model.call("tracker_read", *arguments), event[0], as_arrays(self.estimate)


def drive(model, estimator, rows, context=None, length=100):
    """Both trackers along rows; events, and differences of the estimates (rows,)."""
    python, own = SoilTracker(estimator, length), CompiledTracker(model, context or {})
    events, apart = [], []
    for row in rows:
        expected = python.read(**row)
        code, event, answer = own.read(**row)
        events.append((Event(event), expected.event))
        tracker = own.tracker
        assert tracker.rows_since_change == expected.rows_since_change
        assert tracker.in_question == expected.rows_in_question
        assert tracker.drifting == expected.drifting
        assert tracker.memory.counted[1] == expected.rows_remembered
        if code == model.codes["NO_ROWS"]:
            assert expected.rows_remembered == 0
            continue
        estimate = expected.estimate
        assert code == int(not estimate.in_range)
        found = [answer["mean"] - estimate.mean, answer["std"] - estimate.std]
        apart.append(np.max(np.abs(found) / estimate.std))
    return events, np.array(apart)


def day(seed):
    """Rows of a simulated day in float32, so that both sides read the same numbers."""
    made = simulate_day(seed)
    columns = {k: np.asarray(v, np.float32) for k, v in made.readings.items()}
    columns["slip_std"] = np.full(len(columns["slip"]), SLIP_STD, np.float32)
    return [{k: float(v[i]) for k, v in columns.items()} for i in range(len(columns["slip"]))]


def spoilt(rows, rng):
    """The rows with some in between that cannot be used."""
    odd = ({"torque": np.nan}, {"slip": 1.5}, {"load": np.inf}, {"slip": 0.9})
    stands = [{"slip": 0.0, "torque": 0.0, "load": 60.0 + i} for i in range(5)]
    found = []
    for row in rows:
        found += [row | odd[rng.integers(4)]] if rng.random() < 0.1 else []
        found += [row] * (1 + int(rng.random() < 0.05))
    return [*found[:100], *stands, *found[100:]]


@pytest.mark.parametrize(("seed", "name"), [(0, "wheel"), (1, "any_wheel")])
def test_a_day_with_other_soils_glitches_stuck_sensors_and_a_drift(seed, name, compiled):
    context = ANY_WHEEL if name == "any_wheel" else {}
    estimator = Estimator.load(ROOT / "exported" / f"{name}.onnx")
    estimator = estimator.on(**context) if context else estimator
    rows = spoilt(day(seed), np.random.default_rng(seed))
    rows = rows[:260] if name == "wheel" else rows[:130]
    events, apart = drive(compiled(name), estimator, rows, context)
    assert [own for own, _ in events] == [expected for _, expected in events]
    assert np.quantile(apart, 0.99) < OFTEN and apart.max() < WORST
    kinds = {own for own, _ in events}
    needed = {Event.ACCEPTED, Event.SET_ASIDE, Event.REPEATED, Event.UNUSABLE}
    assert needed | ({Event.SOIL_CHANGED, Event.STUCK} if name == "wheel" else set()) <= kinds


@pytest.mark.skipif(not COMPILERS, reason="no C compiler")
def test_one_row_at_a_time_takes_the_same_decisions(tmp_path):
    """The build for a microcontroller, which fits the rows in question one after the other."""
    source, words = tmp_path / "wheel_small.c", ["--step-rows", "1", "--length", "32"]
    assert main(["export", "c", "wheel_small", str(source), *words]) == 0
    library = compile_library(source, tmp_path / "small.so", COMPILERS[0])
    model = CompiledModel(source.with_suffix(".h"), library)
    assert model.numbers["WHEEL_SMALL_TRACKER_LENGTH"] == 32
    stated = model.numbers["WHEEL_SMALL_TRACKER_BYTES"]
    assert ctypes.sizeof(model.structs["wheel_small_tracker"]) <= stated < 32_000
    estimator = Estimator.load(ROOT / "exported" / "wheel_small.onnx")
    rows = spoilt(day(0), np.random.default_rng(0))[:150]
    events, apart = drive(model, estimator, rows, length=32)
    assert [own for own, _ in events] == [expected for _, expected in events]
    assert {Event.SET_ASIDE, Event.SOIL_CHANGED} <= {own for own, _ in events}
    # rows of a new soil are linear at what the rows before them say, not at the prior
    assert np.quantile(apart, 0.99) < 0.25


def test_a_constant_load_with_noise_is_not_stuck(compiled):
    """Two rows were used, and none after them."""
    estimator = Estimator.load(ROOT / "exported" / "wheel.onnx")
    rows = [row | {"load": 60.0, "load_std": 0.5} for row in day(0)[:24]]
    for row, read in zip(rows, day(0)[:24], strict=True):
        row["torque"] = float(np.float32(read["torque"] * 60.0 / read["load"]))
    events, apart = drive(compiled("wheel"), estimator, rows)
    assert [own for own, _ in events] == [expected for _, expected in events]
    assert Event.STUCK not in {own for own, _ in events} and apart.max() < WORST
    assert [own for own, _ in events].count(Event.ACCEPTED) >= 20


def test_a_bad_standard_deviation_changes_nothing(compiled):
    model = compiled("wheel")
    own = CompiledTracker(model, {})
    for row in day(0)[:5]:
        own.read(**row)
    before = bytes(own.tracker)
    for value in (-1.0, np.inf):
        code, _, _ = own.read(**day(0)[5] | {"torque_std": value})
        assert code == model.codes["BAD_STD"] and bytes(own.tracker) == before


def test_a_tracker_in_which_a_bit_has_flipped_is_refused(compiled):
    """Or the bit is in its scratch memory, or in a gap between fields, and changes no answer."""
    model, rng = compiled("wheel"), np.random.default_rng(4)
    own, rows = CompiledTracker(model, {}), day(0)
    for row in rows[:60]:
        own.read(**row)
    sound, codes = bytes(own.tracker), []
    code, event, _ = own.read(**rows[60])
    expected = code, event, bytes(own.estimate)
    ctypes.memmove(ctypes.byref(own.tracker), sound, len(sound))
    for before in flip_bits(own.tracker, 400, rng):
        code, event, _ = own.read(**rows[60])
        codes.append(code)
        if code == model.codes["NOT_STARTED"]:
            assert bytes(own.tracker) == before
        else:
            assert (code, event, bytes(own.estimate)) == expected
    kind = type(own.tracker)
    scratch = kind.other.size + kind.fresh.size + kind.fresh_rows.size
    refused = codes.count(model.codes["NOT_STARTED"]) / len(codes)
    assert refused > 1.0 - 1.2 * scratch / len(sound)


def test_a_memory_in_which_a_bit_has_flipped_is_refused(compiled):
    model, rng = compiled("wheel"), np.random.default_rng(5)
    memory, row = model.start(), model.rows(slip=[0.3], torque=[3.0], load=[60.0])
    for slip, torque in ((0.1, 1.5), (0.3, 3.0), (0.5, 3.6)):
        assert model.step(memory, model.rows(slip=[slip], torque=[torque], load=[60.0]))[0] == 0
    estimate = model.new("set_estimate")
    assert model.call("set_answer", memory, estimate, model.work) == 0
    gap = ctypes.sizeof(memory) - sum(getattr(type(memory), n).size for n, _ in memory._fields_)
    read = 0
    for before in flip_bits(memory, 1000, rng):
        own = model.new("set_estimate")
        if model.call("set_answer", memory, own, model.work) == 0:
            read += 1
            assert bytes(own) == bytes(estimate)
        else:
            assert model.step(memory, row)[0] == model.codes["NOT_STARTED"]
            assert bytes(memory) == before
    assert read <= (30 if gap else 0)
