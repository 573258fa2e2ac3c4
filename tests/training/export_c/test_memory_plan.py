"""Tensors that are needed at the same time do not share memory; others may."""

import numpy as np
import onnx
import pytest
from compiled_c import ROOT

from training.export_c.c_file import write_c
from training.export_c.program import Program, SharedParts, plan_memory
from training.export_c.tensor import Size, total


def program_of(seed):
    """Statements that each write one tensor and read some of those before."""
    rng = np.random.default_rng(seed)
    program = Program(SharedParts(), {"rows": 7})
    made = []
    for _ in range(40):
        kind = str(rng.choice(["float", "double"]))
        made.append(program.new(kind, (Size.of("rows"), Size(int(rng.integers(1, 40))))))
        read = [made[k] for k in rng.integers(max(len(made) - 6, 0), len(made), 2)]
        program.emit("", made[-1], *read)
    return program


def lives(program, kept):
    """First and last statement of each tensor."""
    touched = {name: [] for name in program.memory}
    for index, statement in enumerate(program.statements):
        for name in statement.names:
            touched[name].append(index)
    end = len(program.statements)
    return {name: (min(at), end if name in kept else max(at)) for name, at in touched.items()}


def test_no_two_live_tensors_overlap():
    for seed in range(20):
        program = program_of(seed)
        kept = frozenset(list(program.memory)[:3])
        plan, life = plan_memory(program, kept), lives(program, kept)
        size = {n: total(shape).most(program.bounds) for n, (_, shape) in program.memory.items()}
        names = list(program.memory)
        for i, a in enumerate(names):
            assert plan.offsets[a] + size[a] <= plan.lengths[program.memory[a][0]]
            for b in names[:i]:
                if program.memory[a][0] != program.memory[b][0]:
                    continue
                together = life[a][0] <= life[b][1] and life[b][0] <= life[a][1]
                apart = (
                    plan.offsets[a] + size[a] <= plan.offsets[b]
                    or plan.offsets[b] + size[b] <= plan.offsets[a]
                )
                assert apart or not together, (a, b)


@pytest.mark.slow
def test_one_row_at_a_time_fits_the_memory_of_a_small_board():
    model = onnx.load(ROOT / "exported" / "any_wheel.onnx")
    metadata = {entry.key: entry.value for entry in model.metadata_props}
    assert write_c(model, metadata, "any_wheel", "", rows=1).work_bytes < 96_000
