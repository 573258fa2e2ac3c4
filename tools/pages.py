"""Blocks of pages that a command prints: `make pages` writes them, `--check` says which are stale.

A block stands between two comments, of which the first has the command and the first words of a
paragraph of its output. Further paragraphs follow where a number says so:

    <!-- output: python examples/papers/climbing.py | Steepest slopes | 2 -->
    ...
    <!-- end of output -->

python tools/pages.py                          write the blocks of all pages
python tools/pages.py --check docs/papers/x.md   compare those of one; status 1 if one is stale
python tools/pages.py --ages                   name those older than a change of their code
"""

from __future__ import annotations

import argparse
import re
import shlex
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from page_ages import changed_rooms, read_states, state_of, write_states

ROOT = Path(__file__).parents[1]
FOLDERS = ("README.md", "docs/**/*.md", "examples/**/*.md")
BLOCK = re.compile(
    r"<!-- output: (?P<command>[^|\n]+?) \| (?P<start>[^|\n]+?)(?: \| (?P<count>\d+))? -->\n"
    r"(?P<text>.*?)<!-- end of output -->",
    re.DOTALL,
)
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
#: Numbers agree within this fraction, or within so many units of their last digit: libraries and
#: processors round sums in another order.
FRACTION, UNITS = 0.02, 1.5


def pages() -> list[Path]:
    """All pages that have a block."""
    found = {page for pattern in FOLDERS for page in ROOT.glob(pattern)}
    return sorted(page for page in found if BLOCK.search(page.read_text(encoding="utf-8")))


def printed(command: str) -> str:
    """The output of a command, run in the repository by this interpreter.

    Raises
    ------
    SystemExit
        If the command fails.
    """
    words = shlex.split(command)
    if words[0] == "python":
        words[0] = sys.executable
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
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


def with_blocks(text: str, output: Callable[[str], str]) -> str:
    """The text of a page with each block as `output` of its command has it now."""

    def block(match: re.Match[str]) -> str:
        count = int(match["count"] or 1)
        now = paragraphs(output(match["command"]), match["start"], count)
        head = match[0].partition("\n")[0]
        return f"{head}\n```text\n{now}\n```\n<!-- end of output -->"

    return BLOCK.sub(block, text)


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


def tell_ages(some: Sequence[Path]) -> None:
    """Print each command whose code has changed since its blocks were written, or says nothing."""
    states, old = read_states(), 0
    for command in dict.fromkeys(c for page in some for c in commands_of(page)):
        rooms = changed_rooms(states.get(command, {}), state_of(command))
        if not rooms:
            continue
        old += 1
        more = f" and {len(rooms) - 4} more" if len(rooms) > 4 else ""
        since = ", ".join(rooms[:4]) + more if command in states else "unknown since when"
        print(f"! older than a change of its code: {command} ({since})")
    print(f"{old} commands may have other figures; run python tools/pages.py PAGE" if old
          else "no code of a page has changed since its blocks were written")  # fmt: skip


def run(arguments: Sequence[str] | None = None) -> int:
    """Write the blocks, or compare them; the exit status."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("pages", nargs="*", type=Path, help="default: all that have a block")
    parser.add_argument("--check", action="store_true", help="write nothing")
    parser.add_argument("--ages", action="store_true", help="run nothing, name those that are old")
    args = parser.parse_args(arguments)
    if args.ages:
        tell_ages(args.pages or pages())
        return 0
    outputs: dict[str, str] = {}

    def output(command: str) -> str:
        if command not in outputs:
            print(f"{command} ...", flush=True)
            outputs[command] = printed(command)
        return outputs[command]

    stale = []
    for page in args.pages or pages():
        before = page.read_text(encoding="utf-8")
        now = with_blocks(before, output)
        if agree(before, now):
            continue
        stale.append(page)
        if not args.check:
            page.write_text(now, encoding="utf-8")
    # what was run just now is as the code is: written, or found in agreement
    if not (args.check and stale):
        own = [page for page in args.pages or pages() if page.resolve().is_relative_to(ROOT)]
        ran = {c for page in own for c in commands_of(page) if c in outputs}
        write_states(read_states() | {command: state_of(command) for command in sorted(ran)})
    said = "stale" if args.check else "written"
    print("\n".join(f"{said}: {page}" for page in stale) or "all pages agree with their commands")
    return int(args.check and bool(stale))


if __name__ == "__main__":
    sys.exit(run())
