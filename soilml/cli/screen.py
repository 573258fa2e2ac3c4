"""What the user asked to see: the form of a result, remarks, details."""

from __future__ import annotations

import sys
from dataclasses import dataclass


@dataclass
class Screen:
    """The choices of --format, -q and -v for the command that runs."""

    form: str = "table"
    quiet: bool = False
    verbose: bool = False

    def choose(self, form: str | None, quiet: bool, verbose: bool) -> None:
        """Take the options of a command."""
        self.form, self.quiet, self.verbose = form or "table", quiet, verbose


SCREEN = Screen()


def is_terminal() -> bool:
    """Whether standard output is a terminal."""
    return sys.stdout is not None and sys.stdout.isatty()
