"""The help texts of all commands, on the page of commands in the place of its comment."""

from __future__ import annotations

import os
from typing import Any

from soilml.cli.main import parser
from soilml.cli.options import leaves

PAGE = "docs/reference/commands"
MARK = "<!-- commands -->"


def helps() -> dict[str, str]:
    """The help text of each command, as in a terminal of 92 columns."""
    os.environ["COLUMNS"] = "92"
    return {name: command.format_help() for name, command in leaves(parser())}


def _insert(app: Any, docname: str, source: list[str]) -> None:
    if docname == PAGE:
        sections = (f"## soilml {name}\n\n```text\n{text}```\n" for name, text in helps().items())
        source[0] = source[0].replace(MARK, "\n".join(sections))


def setup(app: Any) -> dict[str, bool]:
    """Insert the texts as the page is read."""
    app.connect("source-read", _insert)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
