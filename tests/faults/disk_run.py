"""Run commands on a disk that is full or read-only: `make disk-faults`, as root.

Each command first writes onto a disk that holds its whole output; then onto one that holds only a
part of it, and onto one that was made read-only. It must end with status 2 and one line, leave
what was there before, and nothing else; where all was there before, it may say so instead. With
room again, its outputs are those of the first time, bit for bit.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory

sys.path.insert(0, str(Path(__file__).parent))

from fault_run import COMMANDS, completed, digests, prepared, started

#: Shares of the output that a full disk holds; of none, a file takes all room before.
SHARES = (0.0, 0.02, 0.3, 0.7, 0.95)
ROOM, BLOCK, FILLED = 64 << 20, 4096, ".filled"


@contextmanager
def disk(folder: Path, size: int) -> Iterator[None]:
    """A file system in memory of so many bytes at `folder`."""
    command = ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(folder)]
    subprocess.run(command, check=True, capture_output=True, text=True)
    try:
        yield
    finally:
        subprocess.run(["umount", "-l", str(folder)], check=True)


def refused(folder: Path, words: str, before: dict[str, str]) -> list[str]:
    """Faults of a command that cannot write, in words; an empty list where there are none."""
    with started(folder, words) as process:
        error = process.communicate()[1]
    lines = [line for line in error.splitlines() if line.startswith("soilml: ")]
    faults = []
    nothing_to_do = before and process.returncode == 0 and "there before" in error
    if not nothing_to_do and (process.returncode != 2 or len(lines) != 1 or "Traceback" in error):
        faults.append(f"said {error.strip()[-300:]!r} with status {process.returncode}")
    if (left := digests(folder / "out")) != before:
        changed = sorted(name for name in {*left, *before} if left.get(name) != before.get(name))
        faults.append(f"changed or left behind: {changed}")
    return faults


def disturbed(folder: Path, words: str) -> tuple[int, list[str]]:
    """The number of trials of one command, and its faults in words."""
    out = folder / "out"
    out.mkdir(exist_ok=True)
    with disk(out, ROOM):
        completed(folder, words)
        right = digests(out)
        subprocess.run(["mount", "-o", "remount,ro", str(out)], check=True)
        faults = [f"read-only: {fault}" for fault in refused(folder, words, right)]
        sizes = [-(-path.stat().st_size // BLOCK) * BLOCK for path in out.rglob("*")]
    for share in SHARES:
        size = max(BLOCK * 2, int(share * sum(sizes)) // BLOCK * BLOCK)
        with disk(out, size):
            if share == 0.0:
                with suppress(OSError):
                    (out / FILLED).write_bytes(bytes(size + BLOCK))
            before = digests(out)
            faults += [f"full at {share:.0%}: {fault}" for fault in refused(folder, words, before)]
            (out / FILLED).unlink(missing_ok=True)
            subprocess.run(["mount", "-o", f"remount,size={ROOM}", str(out)], check=True)
            completed(folder, words)
            if digests(out) != right:
                faults.append(f"full at {share:.0%}: the rerun differs")
    return 1 + len(SHARES), faults


def main() -> int:
    """Print trials and faults of each command; 1 where there was a fault, 2 without privileges."""
    worst = 0
    with TemporaryDirectory() as name:
        folder = Path(name)
        try:
            with disk(folder, ROOM):
                pass
        except (OSError, subprocess.CalledProcessError):
            print("disk_run: a file system in memory cannot be mounted; run as root")
            return 2
        prepared(folder)
        for command, words in COMMANDS.items():
            shutil.rmtree(folder / "out", ignore_errors=True)
            trials, faults = disturbed(folder, words)
            for fault in faults:
                print(f"{command}, {fault}", flush=True)
            print(f"{command:16} {trials:4} trials {len(faults):4} faults", flush=True)
            worst = max(worst, len(faults))
    return 1 if worst else 0


if __name__ == "__main__":
    sys.exit(main())
