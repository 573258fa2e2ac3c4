"""The process of one job: a request on standard input, and its command as on the command line."""

from __future__ import annotations

import json
import os
import shlex
import sys
import threading
from pathlib import Path

from soilml.cli import main as soilml
from soilml.cli import progress
from soilml.cli.process import fail
from soilml.errors import SoilmlError
from soilml.serve.job_commands import COMMAND, command_of


def main(folder: str) -> int:
    """Run the command of the request in a folder that holds its files; its exit status.

    A line with the command comes first on standard error, then its progress and remarks.
    """
    # paths that are relative to the server's folder must not lead to files that were dropped
    sys.path[:] = [str(Path(entry).resolve()) for entry in sys.path]
    os.chdir(folder)
    request = json.loads(sys.stdin.buffer.readline())
    threading.Thread(target=_end_with_the_server, daemon=True).start()
    progress.FIRST_LINE, progress.BETWEEN_LINES = 0.3, 0.7
    if sheet := request.get("sheet"):
        request["names"] = [f"{name}#{sheet}" for name in request["names"]]
    try:
        words = command_of(request)
    except SoilmlError as error:
        return fail(str(error), 2)
    if not words:
        return 0
    print(f"{COMMAND}{shlex.join(['soilml', *words])}", file=sys.stderr)
    return soilml(words)


def _end_with_the_server() -> None:
    """Standard input ends when the server does, however it ends."""
    while os.read(sys.stdin.fileno(), 4096):
        pass
    os._exit(1)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
