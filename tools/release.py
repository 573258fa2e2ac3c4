"""Builds the release twice, installs it, and measures it: `make release`.

The wheel and the source archive stand in dist/. The sizes, the seconds of an installation without
a cache, and those of the first estimate are printed.
"""

from __future__ import annotations

import hashlib
import shutil
import subprocess
import sys
import tempfile
import time
import venv
from pathlib import Path

ROOT = Path(__file__).parents[1]
DIST = ROOT / "dist"
#: What a board does first.
FIRST = (
    "from soilml import Estimator; "
    "print(Estimator.load('wheel')(slip=0.3, torque=4.2, load=60.0).mean)"
)


def build(folder: Path) -> dict[str, str]:
    """Build wheel and source archive into a folder; their checksums by name."""
    command = [sys.executable, "-m", "hatchling", "build", "-d", str(folder)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    return {f.name: hashlib.sha256(f.read_bytes()).hexdigest() for f in sorted(folder.iterdir())}


def timed(*command: str | Path) -> float:
    """Seconds that a command takes; raises where it fails."""
    start = time.perf_counter()
    subprocess.run([str(word) for word in command], check=True, capture_output=True, cwd="/")
    return time.perf_counter() - start


def size_of(folder: Path) -> float:
    """Size of a folder's files, MB."""
    return sum(f.stat().st_size for f in folder.rglob("*") if f.is_file()) / 1e6


def main() -> int:
    """Build, compare, install and measure."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        first, second = build(folder / "first"), build(folder / "second")
        if first != second:
            print("two builds of the same files differ", file=sys.stderr)
            return 1
        shutil.rmtree(DIST, ignore_errors=True)
        shutil.copytree(folder / "first", DIST)
        for file in sorted(DIST.iterdir()):
            print(f"{file.name}  {file.stat().st_size / 1e6:.1f} MB  sha256 {first[file.name]}")
        venv.create(folder / "board", with_pip=True)
        python = folder / "board" / "bin" / "python"
        bare = size_of(folder / "board")
        wheel = next(DIST.glob("*.whl"))
        constraints = ("--constraint", ROOT / "constraints.txt")
        pip = (python, "-m", "pip", "install", "--quiet", "--no-cache-dir")
        seconds = timed(*pip, *constraints, wheel)
        added = size_of(folder / "board") - bare
        print(f"pip install soilml: {seconds:.0f} s, {added:.0f} MB with numpy and onnxruntime")
        best = min(timed(python, "-c", FIRST) for _ in range(3))
        print(f"interpreter, import, model file and first estimate: {best:.2f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
