"""The process of one job: a request on standard input, progress and the answer on its output."""

from __future__ import annotations

import io
import json
import os
import re
import shlex
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

from soilml.errors import InputError, SoilmlError
from soilml.serve.job_commands import OUT, command_of, look

#: What commands write to standard error: progress in per cent, and remarks.
_SHARE = re.compile(r"(.*): (\d+) %(.*)")
_REMARK = "! "
_PROGRAM = re.compile(r"^soilml[\w -]*: ")
_ANSWERED = (0, 3)  # Exit status of a command with an answer; 3: data that cannot be analysed


def main(folder: str) -> int:
    """Answer the request that stands on standard input, in a folder that holds its files."""
    # paths that are relative to the server's folder must not lead to files that were dropped
    sys.path[:] = [str(Path(entry).resolve()) for entry in sys.path]
    os.chdir(folder)
    output, sys.stdout = sys.stdout, sys.stderr  # what a library prints is no answer
    request = json.loads(sys.stdin.buffer.readline())
    threading.Thread(target=_end_with_the_server, daemon=True).start()

    def say(content: dict[str, Any]) -> None:
        output.write(json.dumps(content, allow_nan=False) + "\n")
        output.flush()

    if sheet := request.get("sheet"):
        request["names"] = [f"{name}#{sheet}" for name in request["names"]]
    try:
        if request["kind"] == "look":
            say({"result": look(request)})
        else:
            say({"result": _run(request, say)})
    except SoilmlError as error:
        say({"error": " ".join(str(error).split())})
    except MemoryError:
        say({"error": "this machine has too little memory for the analysis: leave out rows"})
    return 0


def _run(request: dict[str, Any], say: Callable[[dict[str, Any]], None]) -> dict[str, Any]:
    """Run the command of a request; what it said, and the names of the files that it wrote.

    Raises `InputError` with the line by which the command refuses.
    """
    from soilml.cli import main as soilml
    from soilml.cli import progress

    words = command_of(request)
    progress.FIRST_LINE, progress.BETWEEN_LINES = 0.3, 0.7
    say({"stage": f"soilml {words[0]} ...", "share": None})
    Path(OUT).mkdir(exist_ok=True)
    said, sys.stdout, sys.stderr = _Lines(say), io.StringIO(), sys.stderr
    kept, sys.stderr = sys.stderr, said
    try:
        status = soilml(words)
    finally:
        sys.stderr = kept
    if status not in _ANSWERED:
        raise InputError(_PROGRAM.sub("", said.lines[-1] if said.lines else "no answer"))
    return {
        "command": shlex.join(["soilml", *words]),
        "files": sorted(path.name for path in Path(OUT).iterdir() if path.is_file()),
        "remarks": [line[len(_REMARK) :] for line in said.lines if line.startswith(_REMARK)],
    }


class _Lines(io.TextIOBase):
    """Standard error of a command: each line is the present stage of the job."""

    def __init__(self, say: Callable[[dict[str, Any]], None]) -> None:
        self.say, self.lines, self._open = say, [""][:0], ""

    def write(self, text: str) -> int:
        """Take the lines of a text."""
        *whole, self._open = (self._open + text).split("\n")
        for line in filter(None, whole):
            self.lines.append(line)
            found = _SHARE.fullmatch(line)
            share = None if found is None else int(found[2]) / 100.0
            stage = line if found is None else f"{found[1]}{found[3]}"
            if not line.startswith(_REMARK):
                self.say({"stage": stage, "share": share})
        return len(text)


def _end_with_the_server() -> None:
    """Standard input ends when the server does, however it ends."""
    while os.read(sys.stdin.fileno(), 4096):
        pass
    os._exit(1)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
