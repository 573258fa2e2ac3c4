"""Small runs of the scripts whose figures stand in pages, beside what they printed when these were.

A script that takes long is run here with fewer rows, soils or seeds, in seconds. `tools/pages.py`
records what that prints whenever it writes or confirms the blocks of the script, and a test prints
it again: other numbers mean that the page may be stale, a new arrangement of the code does not.

python tools/page_probes.py examples/papers/chains.py    print the small run of a script
"""

from __future__ import annotations

import importlib.util
import multiprocessing
import os
import shlex
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

ROOT = Path(__file__).parents[1]
RECORDS = ROOT / "tools" / "page_probes"


#: Makes a script small; gives what is called in place of its own beginning, where that is needed.
Shrink = Callable[[ModuleType], Callable[[], object] | None]
#: What is imported once for all small runs.
PRELOADED = ["matplotlib.pyplot", "training.train", "datagen.generate", "soilml.gap"]
_MARK = "page_probe_"  # In names of folders, which differ from run to run, and so do their lines


def _folder() -> Path:
    return Path(tempfile.mkdtemp())


def _nothing(*_: Any, **__: Any) -> None:
    """In place of a function that draws."""


def _lunar(script: ModuleType) -> None:
    import lunar.bearing
    import lunar.evaluation

    whole, folder = script.command, _folder()

    def command(*words: str) -> None:
        """Few rows and centres, and no set posterior, which alone trains for minutes."""
        if words[0] == "generate":
            return whole(*words, "--rows", "1200")
        text = Path(words[1]).read_text(encoding="utf-8").partition("[set_posterior]")[0]
        (folder / "spec.toml").write_text(text.replace("150", "30"), encoding="utf-8")
        return whole("train", str(folder / "spec.toml"), *words[2:])

    script.command, script.OUT, script.SLIPS = command, folder, 9
    lunar.evaluation.SOILS, lunar.evaluation.FITTED, lunar.bearing.SOILS = 6, 2, 4
    lunar.bearing.FACTORS = {"half": 0.5}
    script.Estimator.on = lambda file, **_: file
    script.draw_sweep = script.draw_posteriors = script.show_information = _nothing


def _tracked_robot(script: ModuleType) -> None:
    """Two groups of pulls in place of eight."""
    script.GROUPS = 2


def _chains(script: ModuleType) -> None:
    """The two quickest chains."""
    script.CHAINS = {name: script.CHAINS[name] for name in ("wheel-leg", "track")}
    script.OUT = _folder()


def _first_rows(script: ModuleType, count: int) -> None:
    """The script reads the first rows of its tables alone."""
    import numpy as np

    whole = script.read_table
    script.read_table = lambda *words, **named: whole(*words, **named).rows(np.arange(count))


def _slip_compare(script: ModuleType) -> Callable[[], object]:
    """Six rows of each of the four wheels."""
    script.PARTS = {"equal rim speeds": 6}
    _first_rows(script, 4 * 6)
    return script.compare  # type: ignore[no-any-return]


def _map_compare(script: ModuleType) -> Callable[[], object]:
    """The first third of the drive."""
    _first_rows(script, 160)
    return script.compare  # type: ignore[no-any-return]


def _moon(script: ModuleType) -> None:
    """One law of gravity, and no picture."""
    script.LAWS, script.draw = ("open",), _nothing


#: What makes a script small, by its path.
PROBES: dict[str, Shrink] = {
    "examples/papers/lunar_lssvm.py": _lunar,
    "examples/papers/chains.py": _chains,
    "examples/papers/tracked_robot.py": _tracked_robot,
    "examples/gravity/moon.py": _moon,
    "examples/map/compare.py": _map_compare,
    "examples/slip/compare.py": _slip_compare,
}


def script_of(command: str) -> str:
    """The script that a command of a block runs; "" for a command of soilml."""
    return next((word for word in shlex.split(command) if word.endswith(".py")), "")


def small_run(script: str) -> str:
    """What the small run of a script prints, in a process of its own, without names of folders.

    The process is a fork of one that has imported what most scripts need.

    Raises
    ------
    SystemExit
        If the script fails.
    """
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(PRELOADED)
    with tempfile.TemporaryDirectory() as name:
        files = Path(name, "output"), Path(name, "errors")
        process = context.Process(target=_print_small, args=(script, *files))
        process.start()
        process.join()
        output, errors = (file.read_text(encoding="utf-8") for file in files)
    if process.exitcode:
        sys.exit(f"the small run of {script} failed:\n{errors}")
    return without_folders(output)


def _print_small(script: str, output: Path, errors: Path) -> None:
    """Run a script that has been made small, with what it prints in two files."""
    for stream, file in ((sys.stdout, output), (sys.stderr, errors)):
        with file.open("w") as opened:
            os.dup2(opened.fileno(), stream.fileno())
    sys.argv = [script]
    run_small(ROOT / script, PROBES[script])


def without_folders(output: str) -> str:
    """An output without the lines that name a folder of one run."""
    return "\n".join(line for line in output.splitlines() if _MARK not in line) + "\n"


def record(script: str) -> Path:
    """The file with what the small run printed when the blocks of the script were written."""
    return RECORDS / f"{script.removesuffix('.py').replace('/', '_')}.txt"


def run_small(path: Path, shrink: Shrink) -> None:
    """Run a script that `shrink` has made small."""
    tempfile.template = _MARK
    sys.path.insert(0, str(path.parent))
    spec = importlib.util.spec_from_file_location("probed", path)
    assert spec is not None and spec.loader is not None
    script = sys.modules["probed"] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    own = "run" if hasattr(script, "run") else "main"
    start = shrink(script) or getattr(script, own)
    start()


if __name__ == "__main__":
    run_small(ROOT / sys.argv[1], PROBES[sys.argv[1]])
