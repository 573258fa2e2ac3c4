"""A released file on an emulated Cortex-M4F: answers, instructions and stack of each row."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np

BOARD = Path(__file__).parents[1] / "examples" / "board" / "cortex_m4"
GCC, QEMU = "arm-none-eabi-gcc", "qemu-system-arm"
MISSING = [tool for tool in (GCC, QEMU) if shutil.which(tool) is None]
PROCESSOR = ("-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16")
EMULATOR = ("-M", "mps2-an386", "-nographic", "-icount", "shift=0")
CHANNELS = ("slip", "torque", "load", "sinkage", "drawbar_pull")
NAMES = ("mean", "std", "low", "high")


@dataclass(frozen=True)
class BoardAnswer:
    """Code, counted instructions, stack in bytes, and estimate after one row."""

    code: int
    instructions: int
    stack: int
    estimate: dict[str, np.ndarray]
    in_range: bool


def run_on_board(folder: Path, name: str, rows, context=None) -> list[BoardAnswer]:
    """Answers after each of some rows; `folder` has the exported C file and its header.

    rows: Arrays by channel; NaN where something was not measured.
    context: What holds for the whole set, if it differs from what is usual.
    """
    values = [rows.get(c, np.full(len(rows["slip"]), np.nan)) for c in CHANNELS]
    lines = ["{" + ", ".join(_number(v) for v in row) + "}" for row in zip(*values, strict=True)]
    start = f"{name}_set_start(memory, NULL)"
    given = ""
    if context:
        fields = "".join(f"    given.{k} = {_number(v)};\n" for k, v in context.items())
        given = (
            f"static int start({name}_memory *memory)\n{{\n"
            f"    {name}_context given = {name}_usual_context();\n{fields}"
            f"    return {name}_set_start(memory, &given);\n}}\n"
        )
        start = "start(memory)"
    (folder / "rows.h").write_text(
        f'#include "{name}.h"\n#include <math.h>\n#include <stddef.h>\n'
        f"#define PREFIX(part) {name}_##part\n{given}#define START(memory) {start}\n"
        f"static const float ROWS[][5] = {{\n    {(',' + chr(10) + '    ').join(lines)}\n}};\n"
    )
    program = folder / f"{name}.elf"
    sources = [BOARD / "main.c", BOARD / "startup.c", folder / f"{name}.c"]
    options = ["-O2", "-std=gnu99", "--specs=rdimon.specs", "-nostartfiles", f"-I{folder}"]
    command = [GCC, *PROCESSOR, *options, "-T", BOARD / "mps2.ld", *sources, "-lm", "-o", program]
    subprocess.run(command, check=True, capture_output=True, text=True)
    semihosting = ("-semihosting-config", "enable=on,target=native")
    done = subprocess.run(
        [QEMU, *EMULATOR, *semihosting, "-kernel", program],
        capture_output=True,
        text=True,
        check=True,
        stdin=subprocess.DEVNULL,
        timeout=300,
    )
    return [_answer(line.split()) for line in done.stdout.splitlines()]


def _number(value) -> str:
    return "NAN" if np.isnan(value) else f"{float(np.float32(value))!r}f"


def _answer(words: list[str]) -> BoardAnswer:
    numbers = np.array([float(w) for w in words[3:-1]]).reshape(3, 4)
    estimate = {name: numbers[:, k] for k, name in enumerate(NAMES)}
    return BoardAnswer(int(words[0]), int(words[1]), int(words[2]), estimate, words[-1] == "1")
