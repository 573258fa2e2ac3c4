"""Blocks of pages that a command prints: `make pages` writes them, `--check` says which are stale.

A block stands between two comments, of which the first has the command and the first words of a
paragraph of its output. Further paragraphs follow where a number says so:

    <!-- output: python examples/papers/chains.py | climb | 2 -->
    ...
    <!-- end of output -->

A picture follows a comment with the file that such a command draws, from which it is copied:

    <!-- drawn: demo/papers/track.png -->
    ![track](track.png)

python tools/pages.py                          write the blocks of all pages
python tools/pages.py --check docs/papers/x.md   compare those of one; status 1 if one is stale
python tools/pages.py --quick                  compare those of quick commands, and small runs of
                                               the others with their records (page_probes.py)
"""

from __future__ import annotations

import argparse
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from page_probes import PROBES, record, script_of, small_run

ROOT = Path(__file__).parents[1]
FOLDERS = ("README.md", "docs/**/*.md", "examples/**/*.md")
BLOCK = re.compile(
    r"<!-- output: (?P<command>[^|\n]+?) \| (?P<start>[^|\n]+?)(?: \| (?P<count>\d+))? -->\n"
    r"(?P<text>.*?)<!-- end of output -->",
    re.DOTALL,
)
#: A picture of a page, and where the script that draws it puts it.
PICTURE = re.compile(r"<!-- drawn: (?P<source>\S+) -->\n!\[[^\]]*\]\((?P<target>[^)]+)\)")
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
#: Numbers agree within this fraction, or within so many units of their last digit: libraries and
#: processors round sums in another order.
FRACTION, UNITS = 0.02, 1.5
#: Mean difference of pixels, 0 to 1, from which on a picture is another one and not another font.
OTHER_PICTURE = 0.003
SKIPPED = 77  # Exit status of a command that needs what is not installed here


def pages() -> list[Path]:
    """All pages that have a block."""
    found = {page for pattern in FOLDERS for page in ROOT.glob(pattern)}
    return sorted(page for page in found if BLOCK.search(page.read_text(encoding="utf-8")))


def printed(command: str) -> str | None:
    """The output of a command, run in the repository by this interpreter.

    None where something that it needs is not installed here: its blocks stay as they are.

    Raises
    ------
    SystemExit
        If the command fails.
    """
    words = shlex.split(command)
    if words[0] == "python":
        words[0] = sys.executable
    (ROOT / "build").mkdir(exist_ok=True)  # for files that a command writes beside its output
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode == SKIPPED:
        return print(f"left as it is: {command}: {done.stderr.strip()}")
    if done.returncode:
        sys.exit(f"{command} failed:\n{done.stderr}")
    return done.stdout


def paragraphs(output: str, start: str, count: int) -> str:
    """Paragraphs of an output from the first that begins with these words.

    Raises
    ------
    SystemExit
        If none does.
    """
    parts = re.split(r"\n\s*\n", output.strip("\n"))
    for i, part in enumerate(parts):
        if part.lstrip().startswith(start):
            lines = "\n\n".join(parts[i : i + count]).splitlines()
            return "\n".join(line.rstrip() for line in lines)
    sys.exit(f"no paragraph of the output begins with {start!r}")


def with_blocks(text: str, output: Callable[[str], str | None]) -> str:
    """The text of a page with each block as `output` of its command has it now."""

    def block(match: re.Match[str]) -> str:
        said = output(match["command"])
        if said is None:
            return match[0]
        now = paragraphs(said, match["start"], int(match["count"] or 1))
        head = match[0].partition("\n")[0]
        return f"{head}\n```text\n{now}\n```\n<!-- end of output -->"

    return BLOCK.sub(block, text)


def same_picture(one: Path, other: Path) -> bool:
    """Whether two PNG files show the same, up to how another version draws letters and lines."""
    from matplotlib.image import imread

    if not (one.exists() and other.exists()):
        return False
    a, b = imread(one)[..., :3], imread(other)[..., :3]
    return a.shape == b.shape and float(abs(a - b).mean()) < OTHER_PICTURE


def update_pictures(page: Path) -> list[str]:
    """Copy what the scripts of a page have drawn beside it, where it shows something else."""
    changed = []
    for match in PICTURE.finditer(page.read_text(encoding="utf-8")):
        source, target = ROOT / match["source"], page.parent / match["target"]
        if source.exists() and not same_picture(source, target):
            shutil.copyfile(source, target)
            changed.append(str(target))
    return changed


def agree(page: str, now: str) -> bool:
    """Whether two texts have the same words, and numbers that differ by no more than rounding."""
    if NUMBER.sub("#", _spaced(page)) != NUMBER.sub("#", _spaced(now)):
        return False
    both = zip(NUMBER.findall(page), NUMBER.findall(now), strict=True)
    return all(_near(a, b) for a, b in both)


def _spaced(text: str) -> str:
    """The text with single spaces, and rules of tables of one length: columns follow numbers."""
    return re.sub(r"-{3,}", "---", re.sub(r"\s+", " ", text))


def _near(a: str, b: str) -> bool:
    decimals = len(a.partition(".")[2])
    far = abs(float(a) - float(b))
    return far <= max(UNITS * 10.0**-decimals, FRACTION * abs(float(a)))


def commands_of(page: Path) -> list[str]:
    """Commands of the blocks of a page, each once."""
    found = BLOCK.finditer(page.read_text(encoding="utf-8"))
    return list(dict.fromkeys(match["command"] for match in found))


def run(arguments: Sequence[str] | None = None) -> int:
    """Write the blocks, or compare them; the exit status."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("pages", nargs="*", type=Path, help="default: all that have a block")
    parser.add_argument("--check", action="store_true", help="write nothing")
    parser.add_argument("--quick", action="store_true", help="compare in a minute; write nothing")
    args = parser.parse_args(arguments)
    some = args.pages or pages()
    if args.quick:
        return tell(stale_commands(c for page in some for c in commands_of(page)), "stale")
    outputs: dict[str, str | None] = {}

    def output(command: str) -> str | None:
        if command not in outputs:
            print(f"{command} ...", flush=True)
            outputs[command] = printed(command)
        return outputs[command]

    stale = []
    for page in some:
        before = page.read_text(encoding="utf-8")
        now = with_blocks(before, output)
        if not agree(before, now):
            stale.append(str(page))
            if not args.check:
                page.write_text(now, encoding="utf-8")
        if not args.check:
            stale += update_pictures(page)
    if not args.check:
        record_small_runs(page for page in some if page.resolve().is_relative_to(ROOT))
    return tell(stale, "stale" if args.check else "written") and int(args.check)


def tell(found: Sequence[str], said: str) -> int:
    """Name what was found, and return whether there is something."""
    print("\n".join(f"{said}: {one}" for one in found) or "all pages agree with their commands")
    return int(bool(found))


def stale_commands(commands: Iterable[str]) -> list[str]:
    """Commands whose small run, or whose blocks where they are quick, differ from what is kept."""
    return [command for command in dict.fromkeys(commands) if not is_fresh(command)]


def has_small_run(command: str) -> bool:
    """Whether the script of a command is judged by a small run."""
    return script_of(command) in PROBES


def is_fresh(command: str) -> bool:
    """Whether the small run of a command gives what it gave when its blocks were written.

    A command without a small run is quick: it is run, and compared with its blocks.
    """
    if has_small_run(command):
        script = script_of(command)
        kept = record(script)
        return kept.exists() and agree(kept.read_text(encoding="utf-8"), small_run(script))
    now = printed(command)  # None, and all blocks fresh, where something is not installed
    blocks = (b for page in pages() for b in BLOCK.finditer(page.read_text(encoding="utf-8")))
    own = [block[0] for block in blocks if block["command"] == command]
    return all(agree(block, with_blocks(block, lambda _: now)) for block in own)


def record_small_runs(some: Iterable[Path]) -> None:
    """Keep what the small runs of these pages' scripts print, where it has changed."""
    scripts = dict.fromkeys(script_of(command) for page in some for command in commands_of(page))
    for script in scripts:
        if script not in PROBES:
            continue
        print(f"small run of {script} ...", flush=True)
        kept, now = record(script), small_run(script)
        if not kept.exists() or not agree(kept.read_text(encoding="utf-8"), now):
            kept.parent.mkdir(exist_ok=True)
            kept.write_text(now, encoding="utf-8")


if __name__ == "__main__":
    sys.exit(run())
