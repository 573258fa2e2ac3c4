"""Files for a microcontroller: sizes of their C code, and runs on an emulated Cortex-M4F."""

import numpy as np
import pytest
from compiled_c import COMPILERS, ROOT, CompiledModel, compile_library
from emulated_board import MISSING, NAMES, run_on_board
from simulated_rows import ANY_WHEEL, rows_of

from soilml.cli import main

SMALL = ["wheel_small", "any_wheel_small"]
#: Largest numbers of bytes.
CONSTANTS, WORK, MEMORY, STACK = 64_000, 24_000, 4_000, 2_000
#: Largest number of instructions of one row of torque with its answer, once the memory is full; a
#: row with sinkage and drawbar pull adds three readings.
INSTRUCTIONS = {"wheel_small": 2_000_000, "any_wheel_small": 2_200_000}
OF_ALL_CHANNELS = 150_000
#: Largest difference of a mean or standard deviation between processors, in standard deviations,
#: and of the ends of intervals; they differ in the rounding of sums.
MOMENTS, ENDS = 2e-3, 2e-2


@pytest.fixture(scope="module")
def for_one_row(tmp_path_factory):
    """A released file as C that takes one row in a step, by its name."""
    made = {}

    def exported_file(name):
        if name not in made:
            made[name] = tmp_path_factory.mktemp(name) / f"{name}.c"
            model = str(ROOT / f"exported/{name}.onnx")
            assert main(["export", "c", model, str(made[name]), "--step-rows", "1"]) == 0
        return made[name]

    return exported_file


def stream(name, seed, channels):
    """Rows of one soil, enough to fill the memory, and the context."""
    context = ANY_WHEEL if name.startswith("any") else None
    return rows_of(np.random.default_rng(seed), 48, context, channels), context


@pytest.mark.slow
@pytest.mark.parametrize("name", SMALL)
def test_sizes_and_precision(name, for_one_row):
    source = for_one_row(name)
    header = source.with_suffix(".h").read_text()
    sizes = {
        line.split()[1].removeprefix(name.upper() + "_"): int(line.split()[2])
        for line in header.splitlines()
        if "_BYTES" in line and line.startswith("#define")
    }
    assert sizes["CONSTANT_BYTES"] <= CONSTANTS
    assert sizes["WORK_BYTES"] <= WORK
    assert sizes["MEMORY_BYTES"] <= MEMORY
    memory = header[header.index("float factor[") : header.index(f"}} {name}_memory")]
    assert "double" not in memory


@pytest.mark.slow
@pytest.mark.skipif(bool(MISSING), reason=f"not installed: {', '.join(MISSING)}")
@pytest.mark.skipif(not COMPILERS, reason="no C compiler")
@pytest.mark.parametrize(
    ("name", "channels"),
    [
        pytest.param("wheel_small", ("sinkage", "drawbar_pull"), id="wheel_small-all"),
        pytest.param("any_wheel_small", ("sinkage", "drawbar_pull"), marks=pytest.mark.long),
        *(pytest.param(name, (), marks=pytest.mark.long) for name in SMALL),
    ],
)
def test_an_emulated_cortex_m4_gives_the_same_numbers(name, channels, for_one_row, tmp_path):
    source = for_one_row(name)
    rows, context = stream(name, 5, channels)
    found = run_on_board(source.parent, name, rows, context)
    library = compile_library(source, tmp_path / "host.so", COMPILERS[0])
    model = CompiledModel(source.with_suffix(".h"), library)
    memory = model.start(**(context or {}))
    assert len(found) == len(rows["slip"])
    for row, board in zip(model.rows(**rows), found, strict=True):
        code, answer = model.update(memory, (type(row) * 1)(row))
        assert (board.code, board.in_range) == (code, answer["in_range"])
        for part, limit in zip(NAMES, (MOMENTS, MOMENTS, ENDS, ENDS), strict=True):
            assert (np.abs(board.estimate[part] - answer[part]) < limit * answer["std"]).all()
    assert max(board.instructions for board in found) <= (
        INSTRUCTIONS[name] + (OF_ALL_CHANNELS if channels else 0)
    )
    assert max(board.stack for board in found) <= STACK
    assert min(board.instructions for board in found) > 1e5  # the timer ran
