"""The help texts of all commands, on the page of commands in the place of its comment."""

from __future__ import annotations

import os
from typing import Any

from soilml.cli.main import COMMANDS, GROUPS, parser

PAGE = "docs/reference/commands"
MARK = "<!-- commands -->"


def helps() -> dict[str, str]:
    """The help text of each command, as in a terminal of 92 columns."""
    os.environ["COLUMNS"] = "92"
    found = {}
    for command in COMMANDS:
        choices = next(a.choices for a in parser(command)._actions if a.choices)
        found[command] = choices[command].format_help()  # type: ignore[index]
    return found


def _insert(app: Any, docname: str, source: list[str]) -> None:
    if docname == PAGE:
        words = {own: f"{group} {word}" for group, of in GROUPS.items() for word, own in of.items()}
        sections = (
            f"## soilml {words.get(name, name)}\n\n```text\n{text}```\n"
            for name, text in helps().items()
        )
        source[0] = source[0].replace(MARK, "\n".join(sections))


def setup(app: Any) -> dict[str, bool]:
    """Insert the texts as the page is read."""
    app.connect("source-read", _insert)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
