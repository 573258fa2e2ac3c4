"""Files that a settings file names: the one place where such a name becomes a path."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

from soilml.errors import InputError


@dataclass(frozen=True)
class NamedFiles:
    """Which files a text of settings may name.

    folder: The folder of a file that its user gave on the command line: it may name any file, and
        a name without a folder is one beside it. None for a text of other origin, such as that of a
        page, of an upload, or of the metadata of a file.
    names: What a text of other origin may name nevertheless: files in the working folder.
    hint: What to do instead, for the message.
    """

    folder: Path | None = None
    names: Collection[str] = ()
    hint: str = "use the command line for it"

    def path(self, name: str) -> Path:
        """The path of a name; raises `InputError` for one that the text may not name.

        The file is not opened, and nothing is said of whether it exists.
        """
        if self.folder is not None:
            return self.folder / name
        if name in self.names and Path(name).name == name:
            return Path(name)
        allowed = ", ".join(sorted(self.names)) or "no file"
        raise InputError(
            f"is {name!r}; a text from the page, from an upload or from metadata may name "
            f"{allowed}: {self.hint}"
        )


#: Those of a text that may name no file at all.
NO_FILES = NamedFiles()
