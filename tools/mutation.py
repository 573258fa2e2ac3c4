"""Seeded sample of mutants of the rooms where numbers are made: `make mutation MUTANTS=12`.

A mutant is the source with one change by mutmut. It is tried in a copy of the tree, by those tests
of its room and of the commands and files that use it (`ROOMS`) that call the changed function in
their own process, shortest first, up to a minute (a constant of a module: the tests that call any
function of the file, and those of the room's `test_declarations_*`). It is
killed where a test fails, and survives where none does; survivors are written with their difference
into `build/mutants.txt`. A time-out counts as killed. Drawing is left out. Some mutants change no
result, as `<=` for `<` between numbers that are never equal, and survive rightly: the share that
is killed is a lower bound.
"""

from __future__ import annotations

import argparse
import compileall
import difflib
import importlib
import json
import os
import random
import re
import resource
import shutil
import signal
import sys
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from mutants import Mutant, MutantsOfFile
from scipy.stats import binomtest

ROOT = Path(__file__).parents[1]
#: Source folders, their tests below `tests`, and what is left out: drawing, and other rooms.
ROOMS = {
    "physics": (
        "soilml/physics",
        "soilml/physics commands/test_contract.py soilml/traction soilml/config/test_simulator.py",
        "",
    ),
    "fitting": ("soilml/fitting", "soilml/fitting soilml/identification soilml/gap", ""),
    "inference": (
        "soilml/inference",
        "soilml/inference soilml/identification soilml/gap test_gap_stories.py",
        "",
    ),
    "identification": ("soilml/identification", "soilml/identification", "/plot"),
    "onboard": (
        "soilml/onboard",
        "soilml/onboard commands/test_contract.py commands/test_outputs.py commands/test_reports.py"
        " commands/test_estimate_case.py test_flags.py test_onnx_interface.py test_ros2_example.py"
        " training/test_trained_slip.py training/slip_step",
        "",
    ),
    "gap": (
        "soilml/gap",
        "soilml/gap commands/test_gap_command.py test_gap_stories.py",
        "/pictures",
    ),
}
TESTS = "not network and not long and not browser"
#: What mutants change, as the second table has it.
SORTS = ("arguments", "assignments", "numbers", "operators, comparisons and conditions")
#: Seconds of the tests that try one mutant.
BUDGET = 60.0
#: Libraries that every process of tests shares; soilml is not among them.
SHARED = ("numpy", "scipy.optimize", "scipy.stats", "hypothesis", "pyarrow.parquet", "onnxruntime")


class Recorder:
    """Which functions of soilml each test calls, as file and first line, and how long it takes."""

    def __init__(self, tree: Path):
        self.prefix, self.called = f"{tree}/soilml/", set[tuple[str, int]]()
        self.tests: dict[str, tuple[float, list[tuple[str, int]]]] = {}

    def call(self, frame, event, argument):  # type: ignore[no-untyped-def]
        """Note a function that is called; bodies of modules and classes are none."""
        code = frame.f_code
        if code.co_flags & 1 and code.co_filename.startswith(self.prefix):
            name = code.co_filename[len(self.prefix) - len("soilml/") :]
            self.called.add((name, code.co_firstlineno))

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item):  # type: ignore[no-untyped-def]
        """Functions of one test, with those of its fixtures."""
        self.called, begun = set(), time.perf_counter()
        sys.settrace(self.call)
        try:
            return (yield)
        finally:
            sys.settrace(None)
            self.tests[item.nodeid] = time.perf_counter() - begun, sorted(self.called)


class Selection:
    """Runs the named tests, in their order."""

    def __init__(self, names: list[str]):
        self.place = {name: i for i, name in enumerate(names)}

    def pytest_collection_modifyitems(self, items):  # type: ignore[no-untyped-def]
        """Leave out the others."""
        chosen = [item for item in items if item.nodeid in self.place]
        items[:] = sorted(chosen, key=lambda item: self.place[item.nodeid])


def tested(tree: Path, paths: list[str], plugin: Recorder | Selection, limit: float) -> int | None:
    """Exit status of pytest in a process of its own; None where it took longer than `limit` s."""
    child = os.fork()
    if child == 0:
        os.setsid()
        os.chdir(tree)
        out = os.open("mutation.log", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(out, 1)
        os.dup2(out, 2)
        resource.setrlimit(resource.RLIMIT_DATA, (8 << 30, 8 << 30))
        words = ["-x", "-m", TESTS, "-p", "no:cacheprovider", "--hypothesis-seed=0", *paths]
        status = int(pytest.main(words, plugins=[plugin]))
        if isinstance(plugin, Recorder):
            Path("mutation.json").write_text(json.dumps(plugin.tests))
        sys.stdout.flush()
        os._exit(status)
    due = time.monotonic() + limit
    try:
        while time.monotonic() < due:
            done, status = os.waitpid(child, os.WNOHANG)
            if done:
                return os.waitstatus_to_exitcode(status)
            time.sleep(0.02)
        return None
    finally:
        try:
            os.killpg(child, signal.SIGKILL)
            os.waitpid(child, 0)
        except (ProcessLookupError, ChildProcessError):
            pass  # it had ended


def answer(tree: Path, mutant: Mutant, tests: dict[str, list[Any]]) -> str:
    """What became of one mutant: killed, survived, timed out."""
    near = {
        name: seconds
        for name, (seconds, called) in tests.items()
        if (not mutant.scope and "/test_declarations_" in name)
        or any(path == mutant.path and mutant.scope in (line, 0) for path, line in called)
    }
    # no test calls what runs when the module is imported: all tests of the room may see it
    near = near or {name: seconds for name, (seconds, _) in tests.items()}
    file, source = tree / mutant.path, (tree / mutant.path).read_bytes()
    file.write_text(mutant.source)
    for compiled in (file.parent / "__pycache__").glob(f"{file.stem}.*.pyc"):
        compiled.unlink()  # its time and size may be those of the mutant
    try:
        order = sorted(near, key=lambda name: near[name])
        while len(order) > 1 and sum(near[name] for name in order) > BUDGET:
            order.pop()
        paths = sorted({name.partition("::")[0] for name in order})
        status = tested(
            tree, paths, Selection(order), 30.0 + 5.0 * sum(near[name] for name in order)
        )
    finally:
        file.write_bytes(source)
    if status == int(pytest.ExitCode.USAGE_ERROR):
        raise RuntimeError((tree / "mutation.log").read_text()[-2000:])
    return "timed out" if status is None else "killed" if status else "survived"


def difference(mutant: Mutant, source: str) -> str:
    """The mutant as a unified difference."""
    old, new = source.splitlines(), mutant.source.splitlines()
    return "\n".join(difflib.unified_diff(old, new, mutant.path, "", n=1, lineterm="")) + "\n\n"


def run(room: str, count: int, seed: int, tree: Path, out: Path, counts: Counter[str]) -> None:
    """Try a sample of the mutants of a room; count what became of them."""
    folder, tests, other = ROOMS[room]
    paths = [f"tests/{name}" for name in tests.split()]
    print(f"{room}: the tests without a mutant ...", file=sys.stderr, flush=True)
    if tested(tree, paths, Recorder(tree), 3000.0) != 0:
        raise RuntimeError((tree / "mutation.log").read_text()[-2000:])
    called = json.loads((tree / "mutation.json").read_text())
    files = [str(path.relative_to(tree)) for path in sorted((tree / folder).rglob("*.py"))]
    here = [name for name in files if not (other and re.search(other, name))]
    found = [MutantsOfFile(name, (tree / name).read_text()) for name in here]
    every = [(own, number) for own in found for number in range(len(own))]
    counts[f"{room} all"] = len(every)
    sample = random.Random(f"{seed} {room}").sample(every, min(count, len(every)))
    for i, (own, number) in enumerate(sample):
        mutant = own[number]
        became = answer(tree, mutant, called)
        counts[f"{room} {became}"] += 1
        counts[f"{_sort(mutant)} {became}"] += 1
        where = f"{mutant.path}:{mutant.line}: {mutant.kind}"
        print(f"{room} {i + 1}/{len(sample)} {became}: {where}", file=sys.stderr, flush=True)
        if became == "survived":
            with out.open("a") as survivors:
                survivors.write(difference(mutant, own.source))


def _sort(mutant: Mutant) -> str:
    """What a mutant changes, for the second table."""
    if mutant.kind in ("Call", "Lambda"):
        return "arguments"
    if mutant.kind in ("Assign", "AnnAssign", "AugAssign"):
        return "assignments"
    if mutant.kind in ("Integer", "Float"):
        return "numbers"
    return "operators, comparisons and conditions"


def _rows(title: str, names: Sequence[str], counts: Counter[str]) -> None:
    """Print a table of what became of mutants, by room or by sort."""
    print(
        f"\n| {title} | mutants | tried | killed | timed out | survived | killed, 90 % interval |"
    )
    print("|---|---:|---:|---:|---:|---:|---:|")
    for name in names:
        killed, late, alive = (counts[f"{name} {x}"] for x in ("killed", "timed out", "survived"))
        if tried := killed + late + alive:
            low, high = binomtest(killed + late, tried).proportion_ci(0.9)
            share, of = f"{100 * low:.0f} to {100 * high:.0f} %", counts[f"{name} all"] or ""
            print(f"| {name} | {of} | {tried} | {killed} | {late} | {alive} | {share} |")


def main() -> int:
    """Print the table, after Ctrl-C as well."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--mutants", type=int, default=12, help="mutants of each room")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("rooms", nargs="*", metavar="ROOM", help=", ".join(ROOMS))
    args = parser.parse_args()
    rooms, counts, status = args.rooms or list(ROOMS), Counter[str](), 0
    out = ROOT / "build" / "mutants.txt"
    out.parent.mkdir(exist_ok=True)
    out.write_text("")
    with TemporaryDirectory() as name:
        tree = Path(name).resolve() / "tree"
        unused = shutil.ignore_patterns(".*", "build", "demo", "__pycache__")
        shutil.copytree(ROOT, tree, ignore=unused, symlinks=True)
        compileall.compile_dir(tree / "soilml", quiet=1)
        sys.dont_write_bytecode = True
        os.environ |= {"PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1"}
        (tree / "made").mkdir()
        os.environ |= {"ORT_DISABLE_TELEMETRY": "1", "OMP_NUM_THREADS": "1"}
        os.environ["SOILML_TEST_FILES"] = str(tree / "made")
        sys.path[:] = [str(tree), *(path for path in sys.path if path not in ("", str(ROOT)))]
        for library in SHARED:
            importlib.import_module(library)
        try:
            for room in rooms:
                run(room, args.mutants, args.seed, tree, out, counts)
        except KeyboardInterrupt:
            status = 130
    _rows("room", rooms, counts)
    _rows("what is changed", SORTS, counts)
    return status


if __name__ == "__main__":
    sys.exit(main())
