"""Logs of rigs and rovers become a table of runs: readers, units, slip, torque, load, windows.

`init_map` looks at a log and writes a map with its guesses; `import_log` follows it.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

_HOME = {
    "import_log": "soilml.log_import.workflow",
    "init_map": "soilml.log_import.guesses.map_guess",
    "ImportedLog": "soilml.log_import.result",
    "LogMap": "soilml.log_import.mapping.log_map",
    "read_map": "soilml.log_import.mapping.log_map",
}


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(import_module(_HOME[name]), name)
    raise AttributeError(f"soilml.log_import has no {name!r}")
