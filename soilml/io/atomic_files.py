"""Files that are whole or not there, written to places that are checked first."""

from __future__ import annotations

import os
import secrets
import stat
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from soilml.errors import InputError


def checked(path: str | os.PathLike[str]) -> Path:
    """The file that `path` means, symbolic links followed; there need not be one yet.

    Raises `InputError` where it cannot be written to: a folder stands there, a device, a pipe or a
    socket, or its own folder is missing or locked.
    """
    try:
        target = Path(os.path.realpath(path))
        kind = _kind(target)
        folder = _kind(target.parent)
    except (OSError, ValueError) as error:
        raise InputError(f"{path} cannot be written: {_why(error)}") from None
    if kind is not None and stat.S_ISDIR(kind):
        raise InputError(f"{path} is a folder; needed is a file name to write to")
    if kind is not None and not stat.S_ISREG(kind):
        raise InputError(f"{path} is no file but a device, pipe or socket; needed is a file name")
    if folder is None or not stat.S_ISDIR(folder):
        raise InputError(f"{path}: there is no folder {Path(path).parent}; create it first")
    if not os.access(target.parent, os.W_OK | os.X_OK):
        raise InputError(f"{path} cannot be written: no permission to write into its folder")
    return target


def check_apart(outputs: Iterable[str | os.PathLike[str]], inputs: Iterable[str]) -> None:
    """Check every output as `checked` does; raise `InputError` too where one is also an input."""
    given = list(inputs)
    for output in outputs:
        target = checked(output)
        if any(_same(target, path) for path in given):
            raise InputError(
                f"{output} is read and would be written over; give the output another name"
            )


def named(path: str | None, *suffixes: str) -> list[Path]:
    """The files of one name and these endings; `path` has the first. None where it is None.

    Raises `InputError` where `path` ends otherwise: the name would promise something else.
    """
    if path is None:
        return []
    file = Path(path)
    if file.suffix.lower() != suffixes[0]:
        raise InputError(f"{path}: the output is a {suffixes[0]} file, name it ...{suffixes[0]}")
    return [file, *(file.with_suffix(suffix) for suffix in suffixes[1:])]


@contextmanager
def replacing_all(paths: Sequence[str | os.PathLike[str]]) -> Iterator[list[Path]]:
    """Paths to write to, which become `paths` when the block ends well and vanish when not.

    All are checked before the block, and none is replaced before all are written. The parts lie
    beside their targets as `.NAME.RANDOM.part`, so that two processes do not share one. Raises
    `InputError` as `checked` does and where the disk is full.
    """
    targets = [checked(path) for path in paths]
    parts = [t.parent / f".{t.name[:40]}.{secrets.token_hex(4)}.part" for t in targets]
    try:
        yield parts
        for part in parts:
            with part.open("rb+") as written:
                os.fsync(written.fileno())
        for path in paths:
            checked(path)  # it may have become something else meanwhile
        for part, target in zip(parts, targets, strict=True):
            part.replace(target)
    except OSError as error:
        names = ", ".join(str(path) for path in paths)
        raise InputError(f"{names} cannot be written: {_why(error)}") from error
    finally:
        for part in parts:
            part.unlink(missing_ok=True)


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """`replacing_all` for one file."""
    with replacing_all([path]) as parts:
        yield parts[0]


def save_text(path: str | os.PathLike[str], text: str) -> None:
    """Write a whole text file, or none."""
    with replacing(path) as part:
        part.write_text(text, encoding="utf-8")


@contextmanager
def made_folder(path: str | os.PathLike[str]) -> Iterator[Path]:
    """The folder `path`, made with its parents where missing; those made go if the block fails.

    Raises `InputError` where it cannot be made.
    """
    folder = Path(path)
    new = [place for place in (folder, *folder.parents) if not os.path.lexists(place)]
    with ExitStack() as undo:
        for place in reversed(new):
            undo.callback(_removed, place)
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{folder} cannot be made: {_why(error)}") from None
        yield folder
        undo.pop_all()


def _removed(folder: Path) -> None:
    with suppress(OSError):
        folder.rmdir()


def _kind(path: Path) -> int | None:
    """Mode of what stands at a path; None where nothing does."""
    try:
        return path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        return None


def _same(target: Path, path: str) -> bool:
    try:
        return target.samefile(path)
    except (OSError, ValueError):
        return False


def _why(error: OSError | ValueError) -> str:
    return getattr(error, "strerror", None) or str(error)
