"""Every released file as C: it compiles without a warning, and answers as onnxruntime does."""

import ctypes
import json
import subprocess

import numpy as np
import onnx
import pytest
from compiled_c import COMPILERS, ROOT, WARNINGS
from test_agreement import ONE_FIRST, assert_close, differences

from soilml import Estimator
from soilml.onboard.set_contract import SET_PREFIX
from soilml.onboard.set_posterior import OUTPUTS

RELEASED = sorted(file.stem for file in (ROOT / "exported").glob("*.onnx"))
SINGLES = [name for name in RELEASED if not name.startswith("any_wheel")]
SETS = ["any_wheel", "any_wheel_small", "kls1_wheel", "wheel", "wheel_small"]
#: Largest difference of an estimate from one row, which is computed in double.
SINGLE = 1e-5


def test_the_lists_of_this_file_cover_all_released_files():
    kinds = {}
    for name in RELEASED:
        model = onnx.load(ROOT / "exported" / f"{name}.onnx")
        metadata = {entry.key: entry.value for entry in model.metadata_props}
        kinds[name] = json.loads(metadata.get("set", "{}"))
    sets = [name for name, kind in kinds.items() if kind]
    singles = [name for name, kind in kinds.items() if not kind.get("alone", False)]
    assert (sets, singles) == (SETS, SINGLES) and {*sets, *singles} == {*RELEASED}


@pytest.mark.slow
@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("name", RELEASED)
def test_it_compiles_without_a_warning(name, compiler, exported):
    """`library` compiles them for other tests, with warnings of their flow."""
    command = [compiler, *WARNINGS, "-fsyntax-only", exported(name) / f"{name}.c"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0 and done.stderr == "", done.stderr[:2000]


@pytest.mark.slow
@pytest.mark.parametrize("compiler", ONE_FIRST)
@pytest.mark.parametrize("name", SINGLES)
def test_single_readings(name, compiler, compiled):
    """Readings over the ranges of training and 20 % beyond."""
    model, estimator, rng = (
        compiled(name, compiler),
        Estimator.load(name),
        np.random.default_rng(11),
    )
    readings = {}
    for entry in json.loads(estimator.metadata["inputs"]):
        reach = 0.2 * (entry["upper"] - entry["lower"])
        low = max(entry["lower"] - reach, 0.5 * entry["lower"])
        readings[entry["name"]] = rng.uniform(low, entry["upper"] + reach, 800).astype(np.float32)
    expected = estimator(**readings)
    assert 0.05 < expected.in_range.mean() < 0.95
    scale = np.outer(expected.prior_std, expected.prior_std)
    for i in range(800):
        code, answer = model.single(model.row(**{k: v[i] for k, v in readings.items()}))
        assert answer["in_range"] == expected.in_range[i] == (code == model.codes["OK"])
        for key in ("mean", "std", "low", "high"):
            error = np.abs(answer[key] - getattr(expected, key)[i]) / expected.prior_std
            assert (error < SINGLE).all()
        error = answer["covariance"].reshape(scale.shape) - expected.covariance[i]
        assert (np.abs(error) / scale < SINGLE).all()


def probe_rows(estimator, rng, count):
    """Rows of the file's own probe with 3 % noise, and what holds for them."""
    probe = next(p for p in json.loads(estimator.metadata["probe"]) if p.get("given") is not None)
    pick = rng.integers(0, len(probe["readings"]["slip"]), count)
    rows = {k: np.asarray(v, np.float64)[pick] for k, v in probe["readings"].items()}
    for key in ("torque", "drawbar_pull"):
        if key in rows:
            rows[key] = rows[key] * rng.normal(1.0, 0.03, count)
    return {k: v.astype(np.float32) for k, v in rows.items()}, probe["given"]


@pytest.mark.slow
def test_sets_and_steps(compiled):
    """Of a wheel of other sizes: sets in one call, and the same rows in steps of 1 to 8."""
    model, plain = compiled("kls1_wheel"), Estimator.load("kls1_wheel")
    rng = np.random.default_rng(12)
    found = []
    for _ in range(8):
        rows, given = probe_rows(plain, rng, int(rng.integers(1, 17)))
        given = given if rng.random() < 0.5 else {}
        estimator = plain.on(**given) if given else plain
        expected, _ = estimator.step(estimator.start(), **rows)
        code, answer = model.update(model.start(**given), model.rows(**rows))
        assert answer["in_range"] == bool(expected.in_range) == (code == model.codes["OK"])
        found.append(differences(answer, expected))
        own, memory, first = model.start(**given), estimator.start(), 0
        while first < len(rows["slip"]):
            end = first + int(rng.integers(1, 9))
            part = {k: v[first:end] for k, v in rows.items()}
            code, answer = model.update(own, model.rows(**part))
            expected, memory = estimator.step(memory, **part)
            assert code >= 0 and list(own.counted) == list(memory.counts)
            found.append(differences(answer, expected))
            first += len(part["slip"])
    assert_close(found)


#: Which of 16 rows lack readings.
LACKING = ([0], [5, 6], [15], list(range(9)), list(range(1, 16)), list(range(16)))


@pytest.mark.slow
@pytest.mark.parametrize("missing", [("slip",), ("slip", "torque", "load")])
@pytest.mark.parametrize("name", SETS)
def test_rows_that_lack_a_reading_are_left_out_as_onnxruntime_does(name, missing, compiled):
    """First, middle, last, most, all but one and all rows: counts, flags, and all numbers."""
    model, plain = compiled(name), Estimator.load(name)
    rows, given = probe_rows(plain, np.random.default_rng(13), 16)
    estimator = plain.on(**given) if given else plain
    for lacking in LACKING:
        own = {k: v.copy() for k, v in rows.items()}
        fed = estimator.sets.feed(estimator.sets.rows(rows), estimator.start())
        for key in missing:
            own[key][lacking] = fed[key][lacking] = np.nan
        *outputs, counts, inside = estimator.session.run([*OUTPUTS, "row_in_range"], fed)
        memory = model.start(**given)
        assert model.step(memory, model.rows(**own)) == (0, list(inside))
        assert not any(inside[lacking]) and list(memory.counted) == list(counts)
        _, answer = model.update(model.start(**given), model.rows(**own))
        same_answer(answer, outputs)


def same_answer(answer, outputs):
    """All numbers of an answer agree with outputs of onnxruntime."""
    expected = {k.removeprefix(SET_PREFIX): v for k, v in zip(OUTPUTS, outputs, strict=False)}
    std = np.ravel(expected["std"])
    assert answer["in_range"] == bool(np.ravel(expected["in_range"])[0])
    scales = dict.fromkeys(("mean", "std", "low", "high"), std)
    scales |= {"covariance": np.outer(std, std), "misfit": max(1.0, *np.ravel(expected["misfit"]))}
    for key, scale in scales.items():
        error = np.abs(np.reshape(answer[key], np.shape(expected[key])) - expected[key])
        assert (error < 5e-3 * scale).all(), key


@pytest.mark.slow
def test_a_context_of_zeros_is_refused_and_a_usual_one_is_that_of_the_file(compiled):
    model, estimator = compiled("wheel"), Estimator.load("wheel")
    zeros, memory = model.structs["wheel_context"](), model.new("memory")
    assert model.call("set_start", memory, zeros) == model.codes["BAD_CONTEXT"]
    usual = model.new("context")
    for key, value in estimator.sets.common_errors.items():
        assert getattr(usual, key) == np.float32(value)
    assert model.call("set_start", memory, usual) == 0
    other = model.start()  # of no context at all
    assert bytes(memory) == bytes(other)


@pytest.mark.parametrize("name", ["wheel_linear", "slip_torque"])
def test_version_and_checksums_can_be_read(name, compiled, exported):
    model, metadata = compiled(name), Estimator.load(name).metadata
    identity = getattr(model.library, f"{name}_identity")
    identity.restype = ctypes.c_char_p
    text, header = identity().decode(), (exported(name) / f"{name}.h").read_text()
    for key in ("graph_sha256", "metadata_sha256", "data_sha256", "recipe_sha256"):
        assert f"{key} {metadata[key]}" in text and f'"{metadata[key]}"' in header
    version = metadata["soilml_version"]
    assert text.startswith(f"{name} by soilml {version} ")
    assert f'_SOILML_VERSION "{version}"' in header
