"""Text notebooks (MyST Markdown with code cells), run without Jupyter."""

import os
import re
import subprocess
import sys
from pathlib import Path

CELL = re.compile(r"```\{code-cell\} python\n(?::tags:[^\n]*\n+)?(.*?)```", re.DOTALL)
COMMAND = re.compile(r"^!(.+)$", re.MULTILINE)


def cells(page: Path) -> list[str]:
    """The code cells of a page."""
    return CELL.findall(page.read_text())


def commands(page: Path) -> list[str]:
    """The lines that are typed in a terminal."""
    return [line for cell in cells(page) for line in COMMAND.findall(cell)]


def run(page: Path) -> dict:
    """Run the cells of a page in the working folder; the names that they leave."""

    own = Path(sys.executable).parent
    path = {**os.environ, "PATH": f"{own}{os.pathsep}{os.environ['PATH']}"}

    def shell(line: str) -> None:
        subprocess.run(line, shell=True, check=True, env=path)

    names: dict = {"__name__": "documented", "shell": shell}
    for cell in cells(page):
        exec(COMMAND.sub(lambda line: f"shell({line[1]!r})", cell), names)
    return names
