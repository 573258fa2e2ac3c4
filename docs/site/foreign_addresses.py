"""Pages load nothing from a network: the build fails where one would."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sphinx.application import Sphinx

#: What a browser loads by itself, as opposed to links that somebody follows.
_LOADED = re.compile(
    r"<(?:script|img|iframe|source|video|audio|embed)\b[^>]*\bsrc\s*=\s*[\"']?(?:https?:)?//[^\"'>\s]*"
    r"|<link\b[^>]*\brel=[\"']?(?:stylesheet|preload|preconnect|icon)[^>]*(?:https?:)?//[^\"'>\s]*"
    r"|@import\s+[^;]*//[^;]*|url\(\s*[\"']?(?:https?:)?//[^)]*",
    re.IGNORECASE,
)


def loaded_addresses(folder: Path) -> list[str]:
    """Every foreign address that a page or style of the folder would load."""
    found = []
    for file in sorted(folder.rglob("*")):
        if file.suffix in (".html", ".css"):
            found += [f"{file}: {one[0]}" for one in _LOADED.finditer(file.read_text())]
    return found


def _check(app: Sphinx, exception: Exception | None) -> None:
    from sphinx.errors import ExtensionError

    if exception is None and (found := loaded_addresses(Path(app.outdir))):
        raise ExtensionError("pages would load from a network:\n" + "\n".join(found))


def setup(app: Sphinx) -> dict[str, bool]:
    """Check the pages after they are written."""
    app.connect("build-finished", _check)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
