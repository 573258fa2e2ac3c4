"""The files of a job: what it reads by the names that the user knows, and what it writes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from soilml.errors import InputError

#: The folder of what a job has written, inside its own: no written file can replace a read one.
OUTPUT = "out"
#: A function of the present stage in words, and of the share that is done, if it is known.
Tell = Callable[..., None]


def write_files(texts: Mapping[str, str]) -> list[str]:
    """Write texts by name into the folder of outputs; the names."""
    folder = Path(OUTPUT)
    folder.mkdir(exist_ok=True)
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    return list(texts)


def setting_file(name: str, text: object) -> Path:
    """A text box of the page as a file of this name, so that errors name it."""
    if not isinstance(text, str):
        raise InputError(f"{name} is missing")
    path = Path(name)
    if path.exists():
        raise InputError(f"a dropped file has the name {name}; rename it")
    path.write_text(text, encoding="utf-8")
    return path
