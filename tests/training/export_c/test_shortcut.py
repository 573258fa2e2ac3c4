"""C code takes the short way of readings with noise alone where they are, and only there."""

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


@pytest.fixture(scope="module", params=["wheel", "any_wheel"])
def ways(request, exported, tmp_path_factory):
    """Name, and the file as it is, with the short way always, and with the general way always."""
    name, folder = request.param, tmp_path_factory.mktemp("ways")
    text = (exported(name) / f"{name}.c").read_text()
    assert text.count(BRANCH) == 2  # of an update, and of an answer
    (folder / f"{name}.h").write_text((exported(name) / f"{name}.h").read_text())
    made = []
    for condition in ("*noise_alone", "true || *noise_alone", "false && *noise_alone"):
        source = folder / f"{name}.c"
        source.write_text(text.replace(BRANCH, f"    if ({condition})\n"))
        library = compile_library(source, folder / f"{len(made)}.so", COMPILERS[0], "-O1")
        made.append(CompiledModel(folder / f"{name}.h", library))
    return name, made


def answers(model, context, rows, parts):
    """Estimates after each step, and the answer without new rows."""
    memory, found = model.start(**context), []
    for part in parts:
        _, estimate = model.update(memory, model.rows(**{k: v[part] for k, v in rows.items()}))
        found.append(estimate)
    return [*found, model.answer(memory)[1]]


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


@pytest.mark.slow
def test_readings_with_noise_alone_take_the_short_way_which_changes_rounding_alone(ways):
    name, (model, short, general) = ways
    found = []
    for seed in range(4):
        plain, rows, given = with_noise_alone(name, seed)
        context = given | NO_ERRORS
        taken = answers(model, context, rows, PARTS)
        assert same(taken, answers(short, context, rows, PARTS))
        estimator = plain.on(**context)
        memory = estimator.start()
        for part, own in zip(PARTS, taken, strict=False):
            expected, memory = estimator.step(memory, **{k: v[part] for k, v in rows.items()})
            found.append(differences(own, expected))
        assert not same(taken, answers(general, context, rows, PARTS))  # another order of sums
        found.append(differences(taken[-1], expected))
    assert_close(found)


@pytest.mark.slow
@pytest.mark.parametrize("error", ["slip_bias", "model_error", "slip_std"])
def test_any_error_takes_the_general_way(ways, error):
    name, (model, short, general) = ways
    _, rows, given = with_noise_alone(name, 9)
    context = given | NO_ERRORS
    if error == "slip_std":
        rows["slip_std"] = np.full(12, 0.01, np.float32)
    else:
        context[error] = 0.02
    # noise of slip is in the rows of the memory: an answer without new rows may be short
    own, whole, quick = (
        answers(m, context, rows, PARTS)[: len(PARTS)] for m in (model, general, short)
    )
    assert same(own, whole) and not same(own, quick)
