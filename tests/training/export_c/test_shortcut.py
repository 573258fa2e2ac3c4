"""C code takes the short way of readings with noise alone where they are, and only there."""

import ctypes

import numpy as np
import pytest
from compiled_c import COMPILERS, CompiledModel, compile_library
from test_agreement import assert_close, differences
from test_released_files import loaded, probe_rows

NO_ERRORS = dict.fromkeys(
    ("slip_bias", "load_gain", "torque_gain", "sinkage_bias", "drawbar_pull_bias", "model_error"),
    0.0,
)
BRANCH = "    if (*noise_alone)\n"


class Way:
    """Compiled code that takes the way of its readings (0), always the short one (1), or never."""

    def __init__(self, model, forced):
        self.model, self.forced = model, forced

    def answers(self, context, rows, parts):
        """Estimates after each step, and the answer without new rows."""
        ctypes.c_int.in_dll(self.model.library, "forced").value = self.forced
        memory, found = self.model.start(**context), []
        for part in parts:
            rows_of_part = self.model.rows(**{k: v[part] for k, v in rows.items()})
            found.append(self.model.update(memory, rows_of_part)[1])
        return [*found, self.model.answer(memory)[1]]


@pytest.fixture(scope="module", params=["wheel", "any_wheel"])
def ways(request, exported, tmp_path_factory):
    """Name, and the file as it is, with the short way always, and with the general way always."""
    name, folder = request.param, tmp_path_factory.mktemp("ways")
    text = (exported(name) / f"{name}.c").read_text()
    assert text.count(BRANCH) == 2  # of an update, and of an answer
    source, header = folder / f"{name}.c", exported(name) / f"{name}.h"
    (folder / header.name).write_text(header.read_text())
    switched = text.replace(BRANCH, "    if (forced ? forced > 0 : *noise_alone)\n")
    source.write_text(f"extern int forced;\nint forced = 0;\n{switched}")
    library = compile_library(source, folder / "ways.so", COMPILERS[0])
    model = CompiledModel(header, library)
    return name, [Way(model, forced) for forced in (0, 1, -1)]


def with_noise_alone(name, seed):
    """Rows without an error of torque of their own, and a case without errors."""
    plain = loaded(name)
    rows, given = probe_rows(plain, np.random.default_rng(seed), 12)
    given = given if name == "any_wheel" else {}
    if name == "any_wheel":
        rows["torque_bias"] = np.zeros(12, np.float32)
    return plain, rows, given


PARTS = (slice(0, 5), slice(5, 6), slice(6, 12))


def same(one, other):
    return all(np.array_equal(a[key], b[key]) for a, b in zip(one, other, strict=True) for key in a)


def apart(estimator, rows, found):
    """Differences of estimates after each step from those of onnxruntime, and of an answer."""
    memory, expected = estimator.start(), []
    for part in PARTS:
        answer, memory = estimator.step(memory, **{k: v[part] for k, v in rows.items()})
        expected.append(answer)
    expected += expected[-1:]
    return [differences(own, other) for own, other in zip(found, expected, strict=False)]


@pytest.mark.slow
def test_readings_with_noise_alone_take_the_short_way_which_changes_rounding_alone(ways):
    name, (model, short, general) = ways
    found = []
    for seed in range(4):
        plain, rows, given = with_noise_alone(name, seed)
        context = given | NO_ERRORS
        taken = model.answers(context, rows, PARTS)
        assert same(taken, short.answers(context, rows, PARTS))
        found += apart(plain.on(**context), rows, taken)
        assert not same(taken, general.answers(context, rows, PARTS))  # another order of sums
    assert_close(found)


@pytest.mark.slow
@pytest.mark.parametrize("error", ["slip_bias", "model_error", "slip_std"])
def test_any_error_takes_the_general_way(ways, error):
    name, (model, short, general) = ways
    plain, rows, given = with_noise_alone(name, 9)
    context = given | NO_ERRORS
    if error == "slip_std":
        rows["slip_std"] = np.full(12, 0.01, np.float32)
    else:
        context[error] = 0.02
    # noise of slip is in the rows of the memory: an answer without new rows may be short
    own, whole, quick = (
        way.answers(context, rows, PARTS)[: len(PARTS)] for way in (model, general, short)
    )
    assert same(own, whole) and not same(own, quick)
    assert_close(apart(plain.on(**context), rows, own))
