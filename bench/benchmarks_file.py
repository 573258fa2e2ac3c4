"""Where the measured figures are written: BENCHMARKS.md first, and a page for each subject."""

from __future__ import annotations

import os
import platform
import re
from collections.abc import Mapping, Sequence
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path

from soilml.io.atomic_files import save_text

ROOT = Path(__file__).parents[1]
#: The first page, and the folder of the others, relative to the root of a repository.
FIRST, FOLDER = "BENCHMARKS.md", "docs/benchmarks"
#: Title of each page but the first, by its name, in the order of the contents.
TITLES = {
    "forward-model": "Forward model and synthetic data",
    "identification": "Identification beside the Bayes limit",
    "sets": "Set posterior and fusion",
    "faults": "Faulty readings and wrong models",
    "driving": "A day of driving",
    "training": "Training",
    "board": "On board",
    "prospects": "Advice, pull and climbing",
    "systems": "Wheel-legs",
    "software": "Paths through the code and wall time",
    "gap": "Gap workflow: hidden effects",
    "gap-hybrid": "Gap workflow: rows kept back",
    "gap-speed": "Gap workflow: seconds",
    "gap-measured": "Gap workflow: published tests",
    "adapt": "Files for the board before and after an adaptation",
}
#: Pages whose figures a command of their own prints, by what they compare.
ELSEWHERE = {
    "The gap workflow beside regressions, sealed": ("how-to/challenge", "bench/challenge.py"),
    "Tests on Earth for a pull on the Moon": ("how-to/gravity", "examples/gravity/moon.py"),
}
SUMMARY = "At a glance"


def page_file(name: str, root: Path = ROOT) -> Path:
    """The file of a page; the first one has no name."""
    return root / FOLDER / f"{name}.md" if name else root / FIRST


def sections(name: str, root: Path = ROOT) -> dict[str, str]:
    """Sections of a page as it is, by title; none where there is no such page."""
    file = page_file(name, root)
    parts = file.read_text().split("\n## ")[1:] if file.exists() else []
    found = (part.partition("\n") for part in parts)
    return {title: body.strip("\n") for title, _, body in found}


def write_page(name: str, order: Sequence[str], new: Mapping[str, str], root: Path = ROOT) -> None:
    """Write a page: its new sections, and those of `order` that it has already.

    `order` has the titles of all sections; sections with another title are left out.
    """
    texts = sections(name, root) | dict(new)
    body = "".join(f"\n## {title}\n\n{texts[title]}\n" for title in order if title in texts)
    file = page_file(name, root)
    file.parent.mkdir(parents=True, exist_ok=True)
    save_text(file, f"# {TITLES[name]}\n\n**Machine.** {machine()}\n{body}")


def write_first_page(names: Sequence[str], summary: str, root: Path = ROOT) -> None:
    """Write BENCHMARKS.md: what is measured and how, the pages and their sections, a summary.

    `names` are those of the parts that `bench/run.py` measures. An empty summary keeps that of the
    page, and with it the machine on which it was measured.
    """
    file = page_file("", root)
    before = file.read_text() if file.exists() else ""
    former = re.search(r"^\*\*Machine\.\*\* (.*)$", before, re.MULTILINE)
    environment = former[1] if former and not summary else machine()
    pages = [name for name in TITLES if page_file(name, root).exists()]
    rows = "\n".join(f"| {_link(name)} | {_contents(name, root)} |" for name in pages)
    rows += "".join(
        f"\n| [{what}](docs/{name}.md) | by `python {command}` |"
        for what, (name, command) in ELSEWHERE.items()
    )
    text = (
        "# Benchmarks\n\n"
        "Measured figures of soilml: accuracy and speed of the physics, error and calibration of "
        "the estimators relative to the Bayes limit, detection of faults, latency on board, and "
        "the workflow that finds missing effects. Goals are targets; a goal that is not reached is "
        "marked as missed.\n\n"
        "**Command.** `make bench` writes this page and all others but those of the gap workflow, "
        "which `make bench-gap` and `make gap-real` write, and that of adaptations, by "
        "`python bench/adapt.py`. `python bench/run.py NAME ...` replaces "
        "single sections: "
        f"{', '.join(names)}. No figure is typed by hand.\n\n"
        f"**Machine.** {environment}\n\n"
        f"| page | sections |\n|---|---|\n{rows}\n\n"
        f"## {SUMMARY}\n\n{summary or sections('', root).get(SUMMARY, '')}\n"
    )
    save_text(file, text)


def _link(name: str) -> str:
    return f"[{TITLES[name]}]({FOLDER}/{name}.md)"


def _contents(name: str, root: Path) -> str:
    """Titles of the sections of a page."""
    return "; ".join(sections(name, root))


def source_state(root: Path = ROOT) -> str:
    """A digest of all source on which an analysis of the gap workflow depends."""
    digest = sha256()
    for folder in ("soilml", "datagen/blind_sets"):
        for file in sorted((root / folder).rglob("*.py")):
            digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


def machine() -> str:
    """Processor, cores and versions."""
    name = platform.processor() or platform.machine()
    cpu = Path("/proc/cpuinfo")
    if cpu.exists():
        names = [x.split(":")[1].strip() for x in cpu.read_text().splitlines() if "model name" in x]
        name = names[0] if names else name
    libraries = ("numpy", "scipy", "scikit-learn", "torch", "onnx", "onnxruntime", "pyarrow")
    versions = ", ".join(f"{n} {version(n).split('+')[0]}" for n in libraries)
    return (
        f"{name}, {os.cpu_count()} cores, {platform.system()} {platform.machine()}, Python "
        f"{platform.python_version()}; {versions}. One thread for each process."
    )
