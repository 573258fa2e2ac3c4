"""How much of the code one reading of a table passes: files, functions, arrows between files.

`python bench/run.py code` writes the section; `python bench/code_paths.py` prints it.
"""

from __future__ import annotations

import io
import sys
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from types import CodeType, FrameType
from typing import Any

import numpy as np

from datagen.recipe import read_recipe
from soilml import Estimator, Operating
from soilml.cli import main
from soilml.io.atomic_files import save_text

ROOT = Path(__file__).parents[1]
#: The packages whose files are counted.
PACKAGES = tuple(f"{ROOT / name}/" for name in ("soilml", "datagen", "training"))
ROWS = 24
ABOUT = (
    f"Files, functions and pairs of caller and called file (arrows) that run in one call on {ROWS} "
    "rows of torque and sinkage, the second call in a process. Methods count as functions, "
    "comprehensions do not."
)


@dataclass(frozen=True)
class CodePath:
    """Files, functions (file, line) and arrows (file, file) of the packages that a call passed."""

    files: frozenset[str]
    functions: frozenset[tuple[str, int]]
    arrows: frozenset[tuple[str, str]]


@dataclass(frozen=True)
class CountedCall:
    """A call that is counted, with the most files that it may pass."""

    name: str
    call: Callable[[], object]
    goal: int | None = None
    left_out: str = ""  # files of this folder are not counted

    def found(self) -> CodePath:
        """What the call passes, without the files that are not counted."""
        path = warm(self.call)
        kept = frozenset(f for f in path.files if not self.left_out or self.left_out not in f)
        return CodePath(kept, path.functions, path.arrows)


def count(call: Callable[[], object], packages: tuple[str, ...] = PACKAGES) -> CodePath:
    """What a call passes of the files below folders; the call itself is counted, not its imports.

    An arrow leads from the nearest caller that lies in the folders, also across libraries.
    """
    files: set[str] = set()
    functions: set[tuple[str, int]] = set()
    arrows: set[tuple[str, str]] = set()

    def counted(code: CodeType) -> bool:
        return code.co_filename.startswith(packages) and code.co_name != "<module>"

    def profile(frame: FrameType, event: str, argument: Any) -> None:
        code = frame.f_code
        if event != "call" or not counted(code):
            return
        files.add(code.co_filename)
        if not code.co_name.startswith("<"):
            functions.add((code.co_filename, code.co_firstlineno))
        caller = frame.f_back
        while caller is not None and not counted(caller.f_code):
            caller = caller.f_back
        if caller is not None and caller.f_code.co_filename != code.co_filename:
            arrows.add((caller.f_code.co_filename, code.co_filename))

    before = sys.getprofile()
    sys.setprofile(profile)
    try:
        call()
    finally:
        sys.setprofile(before)
    return CodePath(frozenset(files), frozenset(functions), frozenset(arrows))


def warm(call: Callable[[], object], packages: tuple[str, ...] = PACKAGES) -> CodePath:
    """What the second of two calls passes; the first one imports and fills caches."""
    call()
    return count(call, packages)


def counted_calls(folder: Path) -> list[CountedCall]:
    """The estimate on board, and the commands on a table that is written into a folder."""
    model, rows = ROOT / "examples/wheel/model.toml", folder / "runs.csv"
    save_text(rows, _table())
    estimator = Estimator.load(ROOT / "exported/wheel.onnx")

    def command(*words: str) -> Callable[[], object]:
        return lambda: _run(words[0], str(model), str(rows), *words[1:])

    return [
        CountedCall("`Estimator.__call__`", lambda: estimator(slip=0.3, torque=4.2, load=60.0)),
        CountedCall("`soilml identify --method nonlinear`", command("identify", *NONLINEAR), 56),
        CountedCall(
            "`soilml identify`, which weighs the catalogue, without the files of effects",
            command("identify"),
            77,
            EFFECTS_FOLDER,
        ),
        CountedCall("`soilml identify --method posterior`", command("identify", *POSTERIOR)),
        CountedCall(
            "`soilml gap`, without the files of effects",
            command("gap", "--out", str(folder / "gap")),
            130,
            EFFECTS_FOLDER,
        ),
    ]


NONLINEAR, POSTERIOR = ("--method", "nonlinear"), ("--method", "posterior")
EFFECTS_FOLDER = "soilml/physics/effects/"


def _run(*words: str) -> None:
    """A command, without what it prints.

    Raises:
        RuntimeError: where it fails.
    """
    said = io.StringIO()
    with redirect_stdout(said), redirect_stderr(said):
        status = main(list(words))
    if status:
        raise RuntimeError(said.getvalue())


def _table() -> str:
    """Readings of torque and sinkage at three loads, as CSV."""
    rng = np.random.default_rng(1)
    slip, load = rng.uniform(0.05, 0.6, ROWS), np.repeat([40.0, 60.0, 80.0], ROWS // 3)
    case = read_recipe("wheel").case
    force = case.model(case.soil, Operating(slip=slip, load=load))
    torque = force.torque * (1.0 + 0.02 * rng.standard_normal(ROWS))
    sinkage = force.sinkage + 0.0005 * rng.standard_normal(ROWS)
    rows = zip(load, slip, load, torque, sinkage, strict=True)
    lines = (f"{run:g},{s},{w},{t},{z}" for run, s, w, t, z in rows)
    return "\n".join(["run,slip,load_N,torque_Nm,sinkage_m", *lines, ""])


def section(folder: Path) -> str:
    """The table of all calls."""
    lines = ["| call | files | goal | functions | arrows |", "|---|---:|---:|---:|---:|"]
    for counted in counted_calls(folder):
        found = counted.found()
        goal = "" if counted.goal is None else f"{counted.goal}"
        cells = (len(found.files), goal, len(found.functions), len(found.arrows))
        lines.append(f"| {counted.name} | {' | '.join(map(str, cells))} |")
    return "\n".join(lines)


if __name__ == "__main__":
    with TemporaryDirectory() as name:
        print(f"{ABOUT}\n\n{section(Path(name))}")
