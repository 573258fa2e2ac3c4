"""Completes the tree: folders with a README, and pages that the start page does not name."""

from __future__ import annotations

import re
from pathlib import Path

from sphinx.application import Sphinx

ROOT = Path(__file__).parents[2]
#: The line of the tree in docs/index.md whose place further pages of docs/ take.
MARK = "(further pages)\n"
_TREE_OF_FOLDER = "\n```{toctree}\n:hidden:\n:glob:\n\n*\n```\n"


def further_pages(index: str) -> list[str]:
    """Pages of docs/ itself that the tree does not name."""
    named = set(re.findall(r"<(.+?)>$", index, flags=re.MULTILINE))
    pages = (page.stem for page in sorted((ROOT / "docs").glob("*.md")))
    return [page for page in pages if page not in named and page != "index"]


def _complete(app: Sphinx, docname: str, source: list[str]) -> None:
    if docname == "docs/index":
        lines = "".join(f"{page}\n" for page in further_pages(source[0]))
        source[0] = source[0].replace(MARK, lines)
    elif re.fullmatch(r"docs/\w+/README", docname):
        source[0] += _TREE_OF_FOLDER


def setup(app: Sphinx) -> dict[str, bool]:
    """Complete pages as they are read."""
    app.connect("source-read", _complete)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
