"""A map for raw logs, with guesses."""

from __future__ import annotations

from typing import Any

from soilml.log_import.guesses.map_text import init_map
from soilml.serve.answers.job_output import Tell


def answer(request: dict[str, Any], tell: Tell) -> dict[str, Any]:
    """The text of the map, and how many of its lines need a look."""
    tell("looking at the log")
    text = init_map(request["names"])
    marked = sum("CHANGE" in line or "NEEDED" in line for line in text.splitlines()[3:])
    return {"map": text, "marked": marked}
