"""Hostile numbers in every input of every released file: all outputs are finite.

docs/reference/onnx.md promises it of the ONNX files, docs/how-to/deploy.md of the C code.
"""

import ctypes
import json
from pathlib import Path

import numpy as np
import onnxruntime as ort
import pytest
from compiled_c import COMPILERS

ROOT = Path(__file__).parents[1]
RELEASED = sorted((ROOT / "exported").glob("*.onnx"))
HOSTILE = (np.nan, np.inf, -np.inf, 0.0, -1.0, 1e-38, 3e38, -1e38, 1e9)
#: Random calls of each file, with hostile numbers in several inputs at once.
MIXTURES = 60
#: Files of which a quick test has the graph of another kind.
ALIKE = ("kls1_wheel", "wheel_small", "any_wheel_small", "wheel_mlp", "slip_torque_known",
         "slip_vibration_known", "slip_torque_paper", "slip_vibration_paper")  # fmt: skip


def files(names):
    """Names of files; those of the same kind as another one are left to `make test-long`."""
    return [pytest.param(n, marks=[pytest.mark.long] * (n in ALIKE), id=n) for n in names]


GOOD = {
    "slip": [0.1, 0.2, 0.3, 0.5],
    "torque": [1.6, 2.3, 2.7, 3.2],
    "load": [60.0, 60.0, 60.0, 60.0],
    "vibration": [2.0, 3.0, 4.0, 5.0],
}


def session_of(model):
    options = ort.SessionOptions()
    options.log_severity_level = 4
    return ort.InferenceSession(model, options, providers=["CPUExecutionProvider"])


def sound_feeds(session, context):
    """Calls that a file answers: of single rows, of a set, and of a set with earlier rows."""
    inputs = {i.name: i for i in [*session.get_inputs(), *session.get_overridable_initializers()]}
    rows = next((i.shape[0] for n, i in inputs.items() if n == "slip"), "rows")
    rows = rows if isinstance(rows, int) else 4
    feed = {name: np.asarray(GOOD[name][:rows]) for name in GOOD if name in inputs}
    feed |= {name: np.asarray([np.sqrt(a * b)]) for name, (a, b) in context.items()}
    feed = {name: values.astype(np.float32) for name, values in feed.items()}
    if "joint" in inputs:
        yield feed
        feed = feed | {"joint": np.asarray([True])}
    if "memory" in inputs and isinstance(inputs["memory"].shape[0], int):  # of fixed shapes
        state = {"memory": np.zeros(inputs["memory"].shape), "counted": np.zeros(3)}
        feed |= {name: values.astype(np.float32) for name, values in state.items()}
    yield feed
    if "memory" in inputs and "joint" in feed:
        names = ("memory_out", "counted_out")
        yield feed | dict(zip(("memory", "counted"), session.run(names, feed), strict=True))


def with_hostile_entries(values, value, places):
    changed = values.copy()
    changed.reshape(-1)[places] = value
    return changed


def hostile_feeds(session, context, rng):
    """Each number in each input, in one row or in all, and for all rows; then many at once."""
    inputs = {i.name: i for i in [*session.get_inputs(), *session.get_overridable_initializers()]}
    for sound in sound_feeds(session, context):
        sizes = {"rows": len(sound["load"]), "kept": 0}
        whole = {
            name: sound.get(name, np.full(sizes.get(entry.shape[0], entry.shape[0]), 0.01))
            for name, entry in inputs.items()
            if name != "joint" and (name != "memory" or name in sound)
        }
        whole = {name: np.asarray(values, np.float32) for name, values in whole.items()}
        for i, (name, values) in enumerate(whole.items()):
            for j, value in enumerate(HOSTILE):
                places = (0, slice(None))[(i + j) % 2]
                yield sound | {name: with_hostile_entries(values, value, places)}
                if isinstance(inputs[name].shape[0], str) and name != "memory":
                    yield sound | {name: np.full(1, value, np.float32)}
        for _ in range(MIXTURES):
            feed = dict(sound)
            for name, values in whole.items():
                if values.size and rng.random() < 0.25:
                    places = rng.random(values.size) < rng.choice([0.3, 1.0])
                    value = rng.choice(HOSTILE, places.sum())
                    feed[name] = with_hostile_entries(values, value, places)
            yield feed


def check_finite(session, context, seed):
    names, calls = [o.name for o in session.get_outputs()], 0
    for feed in hostile_feeds(session, context, np.random.default_rng(seed)):
        for name, value in zip(names, session.run(names, feed), strict=True):
            if value.dtype == np.float32:
                assert np.isfinite(value).all(), (name, feed)
        calls += 1
    assert calls > MIXTURES


def context_of(metadata):
    return json.loads(metadata["set"])["context"] if "set" in metadata else {}


@pytest.mark.parametrize("name", files([file.stem for file in RELEASED]))
def test_all_outputs_are_finite_for_all_inputs(name):
    session = session_of(str(ROOT / "exported" / f"{name}.onnx"))
    metadata = session.get_modelmeta().custom_metadata_map
    check_finite(session, context_of(metadata), seed=1)


@pytest.mark.parametrize("name", ["wheel_radius", "bearing_modulus", "cohesion_max"])
@pytest.mark.parametrize("file", ["any_wheel", "any_wheel_small"])
def test_a_wheel_of_no_size_or_below_puts_all_rows_out_of_range(file, name):
    session = session_of(str(ROOT / "exported" / f"{file}.onnx"))
    context = context_of(session.get_modelmeta().custom_metadata_map)
    (sound,) = sound_feeds(session, context)
    for value in (0.0, -1.0, np.nan):
        feed = sound | {name: np.full(1, value, np.float32)}
        outputs = ["set_in_range", "row_in_range", "set_std"]
        in_range, rows, std = session.run(outputs, feed)
        assert not in_range.any() and not rows.any() and (std > 0.0).all()


@pytest.mark.parametrize("name", ["wheel", "wheel_small"])
def test_a_row_without_load_is_left_out_and_changes_no_answer(name):
    session = session_of(str(ROOT / "exported" / f"{name}.onnx"))
    *_, sound, _ = sound_feeds(session, {})
    wanted = ["set_mean", "set_std", "set_misfit", "row_in_range", "set_in_range"]
    for load in (0.0, -1.0, -1e38, 1e-38):
        mean, std, misfit, rows, in_range = session.run(
            wanted, sound | {"load": np.asarray([60.0, load, 60.0, 60.0], np.float32)}
        )
        kept = {k: v if k == "joint" else v[[0, 2, 3]] for k, v in sound.items()}
        expected = session.run(wanted, kept)
        assert in_range[0] and list(rows) == [True, False, True, True]
        np.testing.assert_allclose(mean, expected[0], atol=1e-3 * std.max(), rtol=1e-3)
        np.testing.assert_allclose(misfit, expected[2], rtol=1e-2, atol=1e-3)


@pytest.mark.slow
@pytest.mark.skipif(not COMPILERS, reason="no C compiler")
@pytest.mark.parametrize("name", ["wheel", "wheel_small", "any_wheel_small"])
def test_c_answers_finite_numbers_or_refuses_and_keeps_the_memory(name, compiled):
    model, rng = compiled(name), np.random.default_rng(3)
    session = session_of(str(ROOT / "exported" / f"{name}.onnx"))
    context = context_of(session.get_modelmeta().custom_metadata_map)
    usual = {key: float(np.sqrt(a * b)) for key, (a, b) in context.items()}
    fields = [field for field, _ in model.structs[f"{name}_row"]._fields_]
    good = {key: np.asarray(GOOD[key]) for key in ("slip", "torque", "load")}
    answered = refused = 0
    for field in fields:
        for value in HOSTILE:
            for count in (0, 4):
                memory = model.start(**usual)
                if count:
                    assert model.update(memory, model.rows(**good))[0] >= 0
                before = bytes(memory)
                rows = {key: values.copy() for key, values in good.items()}
                rows.setdefault(field, np.full(4, 0.01))[int(rng.integers(4))] = value
                code, answer = model.update(memory, model.rows(**rows))
                if code < 0:
                    assert bytes(memory) == before
                    refused += 1
                    continue
                answered += 1
                for key, found in answer.items():
                    assert np.isfinite(found).all(), (field, value, key)
                    assert code == 0 or key != "in_range" or not found
    assert answered > 50 and refused > 50


@pytest.mark.slow
@pytest.mark.skipif(not COMPILERS, reason="no C compiler")
def test_no_context_is_refused_in_c_where_a_wheel_must_be_set(compiled):
    model = compiled("any_wheel_small")
    memory = model.new("memory")
    ctypes.memset(ctypes.byref(memory), 7, ctypes.sizeof(memory))
    before = bytes(memory)
    assert model.call("set_start", memory, None) == model.codes["BAD_CONTEXT"]
    assert bytes(memory) == before
