"""Takes progress bars out of the outputs of commands; a terminal would have overwritten them."""

from __future__ import annotations

import re

from docutils import nodes
from sphinx.application import Sphinx

_CURSOR = re.compile(r"\x1b?\[?\?25[lh]")
#: The rule below the head of a table of more than 100 columns, whose lines are not to be broken.
_WIDE = re.compile(r"^-[- ]{100,}$", re.MULTILINE)
_BAR = re.compile(r"^.*[━╸╺].*\n?|^[ \w-]+ 0:\d\d:\d\d *$\n?", re.MULTILINE)


def cleaned(output: str) -> str:
    """The output without bars, moves of the cursor and empty lines at its ends."""
    text = _BAR.sub("", _CURSOR.sub("", output.replace("\r", "")))
    return text.strip("\n") + "\n"


def _clean(app: Sphinx, doctree: nodes.document) -> None:
    for node in doctree.findall(nodes.literal_block):
        if "stream" in node.get("classes", ()) or node.get("language") == "myst-ansi":
            text = cleaned(node.astext())
            node.rawsource = text
            node.children = [nodes.Text(text)]
            if _WIDE.search(text):
                node["classes"].append("wide")


def setup(app: Sphinx) -> dict[str, bool]:
    """Clean each page after it is read."""
    app.connect("doctree-read", _clean)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
