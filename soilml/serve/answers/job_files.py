"""The files of a job: what it reads by the names that the user knows, and what it writes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from soilml.config.case import Case, read_case
from soilml.errors import InputError
from soilml.io.named_files import NO_FILES

#: Folders of a job: of the files that it reads, in which it works, and of what it has written. No
#: written file can replace a read one, and a dropped file may have any name.
READ, WRITTEN = "read", "written"
MODEL_FILE = "MODEL.toml"  # Name of the page's model file in messages
#: A function of the present stage in words, and of the share that is done, if it is known.
Tell = Callable[..., None]


def write_files(texts: Mapping[str, str]) -> list[str]:
    """Write texts by name into the folder of outputs; the names."""
    folder = Path("..") / WRITTEN
    folder.mkdir(exist_ok=True)
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    return list(texts)


def page_case(request: Mapping[str, object]) -> Case:
    """The case of the page's model file, which may name no file; raises as `read_case` does."""
    file = setting_file(MODEL_FILE, request.get("model"))
    return read_case(file, with_bias=True, files=NO_FILES, with_explanations=True)


def setting_file(name: str, text: object) -> Path:
    """A text box of the page as a file of this name, so that errors name it."""
    if not isinstance(text, str):
        raise InputError(f"{name} is missing")
    path = Path(name)
    if path.exists():
        raise InputError(f"a dropped file has the name {name}; rename it")
    path.write_text(text, encoding="utf-8")
    return path
