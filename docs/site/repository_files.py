"""Links to Markdown files of the repository that are no pages of the site become downloads."""

from __future__ import annotations

import os
import re
from pathlib import Path

from sphinx.application import Sphinx

ROOT = Path(__file__).parents[2]
_LINK = re.compile(r"(?<!!)\[([^\]`]+)\]\((?!https?:)([^)#\s]+\.md)(?:#[^)\s]*)?\)")


def _as_downloads(app: Sphinx, docname: str, source: list[str]) -> None:
    folder = (ROOT / docname).parent

    def link(found: re.Match[str]) -> str:
        target = Path(os.path.normpath(folder / found[2]))
        if str(target.relative_to(ROOT).with_suffix("")) in app.env.found_docs:
            return found[0]
        return f"{{download}}`{found[1]} <{found[2]}>`"

    source[0] = _LINK.sub(link, source[0])


def setup(app: Sphinx) -> dict[str, bool]:
    """Rewrite pages as they are read."""
    app.connect("source-read", _as_downloads)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
