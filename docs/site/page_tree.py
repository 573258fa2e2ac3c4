"""Completes the tree: pages of papers and cards of released files stand below their first page."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sphinx.application import Sphinx

#: First pages whose folder is their tree.
FOLDERS = ("docs/papers/README", "exported/README")
_TREE_OF_FOLDER = "\n```{toctree}\n:hidden:\n:glob:\n\n*\n```\n"


def _complete(app: Sphinx, docname: str, source: list[str]) -> None:
    if docname in FOLDERS:
        source[0] += _TREE_OF_FOLDER


def setup(app: Sphinx) -> dict[str, bool]:
    """Complete pages as they are read."""
    app.connect("source-read", _complete)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
