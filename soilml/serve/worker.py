"""The process of one job: a request on standard input, progress and the answer on its output."""

from __future__ import annotations

import importlib
import json
import os
import sys
import threading
from pathlib import Path
from typing import Any

from soilml.errors import SoilmlError

#: Module and function (request, tell) that answer each kind of job.
KINDS = {
    "look": ("logs", "look"),
    "map": ("map_editor", "edit"),
    "import": ("logs", "import_logs"),
    "estimate": ("estimate", "answer"),
    "gap": ("gap", "answer"),
    "design": ("design", "answer"),
}


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

    def tell(stage: str, share: float | None = None) -> None:
        say({"stage": stage, "share": share})

    from soilml.report.page import finite_or_null

    if sheet := request.get("sheet"):
        request["names"] = [f"{name}#{sheet}" for name in request["names"]]
    try:
        module, function = KINDS[request["kind"]]
        answer = getattr(importlib.import_module(f"soilml.serve.answers.{module}"), function)
        say({"result": finite_or_null(answer(request, tell))})
    except SoilmlError as error:
        say({"error": " ".join(str(error).split())})
    except MemoryError:
        say({"error": "this machine has too little memory for the analysis: leave out rows"})
    return 0


def _end_with_the_server() -> None:
    """Standard input ends when the server does, however it ends."""
    while os.read(sys.stdin.fileno(), 4096):
        pass
    os._exit(1)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
