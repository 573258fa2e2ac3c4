"""Files that a settings file names: the one place where such a name becomes a path."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from soilml.errors import InputError


@dataclass(frozen=True)
class NamedFiles:
    """Which files a text of settings may name.

    folder: The folder of a file that its user gave on the command line: it may name any file, and
        a name without a folder is one beside it. None for a text of other origin, such as that of a
        page, of an upload, or of the metadata of a file, which may name none.
    """

    folder: Path | None = None

    def path(self, name: str) -> Path:
        """The path of a name; raises `InputError` for one that the text may not name.

        The file is not opened, and nothing is said of whether it exists.
        """
        if self.folder is None:
            raise InputError(
                f"is {name!r}; a text from the page, from an upload or from metadata may name no "
                "file: use the command line for it"
            )
        return self.folder / name


#: Those of a text that may name no file at all.
NO_FILES = NamedFiles()
