"""Output files, written atomically as sets, also where the process is stopped.

A process that is killed may leave temporary files `.NAME.RANDOM.part`, and no half of an output.
"""

from __future__ import annotations

import errno
import os
import signal
import stat
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

from soilml.errors import InputError
from soilml.io.cell_text import one_line

replaced: list[str] = []  # Names of outputs that this process has replaced, in order
_SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP")
_temporary: set[Path] = set()  # Temporary files of this process


def is_writing() -> bool:
    """Whether this process has temporary files."""
    return bool(_temporary)


def clear_interrupted() -> None:
    """Remove what this process left where a signal arrived as a set of files began or ended."""
    _remove(list(_temporary))


def _remove(parts: Iterable[Path]) -> None:
    for part in parts:
        with suppress(OSError):
            part.unlink(missing_ok=True)
        _temporary.discard(part)


@contextmanager
def _signals_after(said: str) -> Iterator[None]:
    """Signals that ask this process to stop act after the block; `said` is then their message."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    arrived: list[int] = []
    before: dict[int, Any] = {}
    try:
        for name in _SIGNALS:
            if (number := getattr(signal, name, None)) is not None:
                handler = signal.getsignal(number)
                if callable(handler):
                    before[number] = handler
                    signal.signal(number, lambda n, frame: arrived.append(n))
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    if arrived:
        try:
            signal.raise_signal(arrived[0])
        except (KeyboardInterrupt, SystemExit) as stop:
            stop.said = said  # type: ignore[union-attr]
            raise


def check_writable(path: str | os.PathLike[str]) -> Path:
    """The file at `path` with symbolic links resolved; it need not exist yet.

    Raises `InputError` where it cannot be written: the path is a folder, a device, a pipe or a
    socket, the file is read-only, or the folder of the file is missing or not writable.
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
        raise InputError(f"{path} is a device, pipe or socket; needed is a file name")
    if kind is not None and not kind & (stat.S_IWUSR | stat.S_IWGRP | stat.S_IWOTH):
        raise InputError(f"{path} is read-only; make it writable, or give another name")
    if folder is None or not stat.S_ISDIR(folder):
        missing = target.parent if Path(path).is_symlink() else Path(path).parent
        raise InputError(
            f"{one_line(path)}: the folder {one_line(missing)} does not exist; create it first"
        )
    if not os.access(target.parent, os.W_OK | os.X_OK):
        raise InputError(f"{path} cannot be written: no permission to write to its folder")
    return target


def check_outputs(outputs: Iterable[str | os.PathLike[str]], inputs: Iterable[str]) -> None:
    """Check that every output can be written and is none of the inputs; raises `InputError`."""
    read = list(inputs)
    for output in outputs:
        target = check_writable(output)
        if any(_same(target, path) for path in read):
            raise InputError(
                f"{output} is an input and would be overwritten; give the output another name"
            )


def output_files(path: str | None, *suffixes: str) -> list[Path]:
    """The output files of one name with these suffixes; an empty list where `path` is None.

    Raises `InputError` where `path` does not have the first suffix, which names its format.
    """
    if path is None:
        return []
    file = Path(path)
    if file.suffix.lower() != suffixes[0]:
        raise InputError(
            f"{one_line(path)}: the output is a {suffixes[0]} file; its name must end "
            f"in {suffixes[0]}"
        )
    return [file, *(file.with_suffix(suffix) for suffix in suffixes[1:])]


@contextmanager
def atomic_outputs(
    paths: Sequence[str | os.PathLike[str]], remove: Sequence[str | os.PathLike[str]] = ()
) -> Iterator[list[Path]]:
    """Temporary paths that are renamed to `paths` when the block succeeds, and deleted otherwise.

    All targets are checked before the block, and none is replaced before all files are written.
    Then all are replaced: a signal waits until they are. Files of an earlier set that the new one
    does not have are in `remove`. A temporary file lies in the folder of its
    target as `.NAME.RANDOM.part`, so that two processes do not share one. A file that is replaced
    keeps its permissions.

    Raises `InputError` as `check_writable` does, and where the disk is full.
    """
    targets, token = [check_writable(path) for path in paths], os.urandom(4).hex()
    names = ", ".join(str(path) for path in paths)
    parts = [t.parent / f".{t.name[:40]}.{token}.part" for t in targets]
    try:
        _temporary.update(parts)
        yield parts
        for part, target in zip(parts, targets, strict=True):
            with part.open("rb+") as written:
                if (kind := _kind(target)) is not None:
                    os.fchmod(written.fileno(), stat.S_IMODE(kind))
                os.fsync(written.fileno())
        for path in paths:
            check_writable(path)  # it may have changed since the first check
        with _signals_after(f"interrupted; complete before that: {names}"):
            for part, target in zip(parts, targets, strict=True):
                part.replace(target)
            for path in remove:
                Path(os.path.realpath(path)).unlink(missing_ok=True)
            if paths and not any(target.suffix == ".part" for target in targets):
                replaced.append(names)
    except OSError as error:
        raise InputError(f"{names} cannot be written: {_why(error)}") from error
    finally:
        _remove(parts)


@contextmanager
def atomic_output(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Like `atomic_outputs`, for one file."""
    with atomic_outputs([path]) as parts:
        yield parts[0]


def save_text(path: str | os.PathLike[str], text: str) -> None:
    """Write a text file atomically."""
    with atomic_output(path) as part:
        part.write_text(text, encoding="utf-8")


def write_files(
    contents: Mapping[Path, str | Callable[[Path], object]],
    *,
    folders: Iterable[str | os.PathLike[str] | None] = (),
    remove: Sequence[str | os.PathLike[str]] = (),
) -> None:
    """Write files as one set, all or none, as `atomic_outputs` does.

    contents: The text of each file, or a function that writes it to the path that it is given.
    folders: Folders that are created where they are missing.
    """
    with ExitStack() as created:
        for folder in folders:
            if folder is not None:
                created.enter_context(create_folder(folder))
        with atomic_outputs(list(contents), remove=remove) as parts:
            for part, content in zip(parts, contents.values(), strict=True):
                if isinstance(content, str):
                    part.write_text(content, encoding="utf-8")
                else:
                    content(part)


@contextmanager
def create_folder(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Create the folder `path` and its missing parents; if the block fails, remove those created.

    Raises `InputError` where the folder cannot be created.
    """
    folder = Path(path)
    missing = [path for path in (folder, *folder.parents) if not os.path.lexists(path)]
    with ExitStack() as undo:
        for new in reversed(missing):
            undo.callback(_remove_if_empty, new)
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{folder} cannot be created: {_why(error)}") from None
        yield folder
        undo.pop_all()


def _remove_if_empty(folder: Path) -> None:
    with suppress(OSError):
        folder.rmdir()


def _kind(path: Path) -> int | None:
    """File mode of a path; None where it does not exist."""
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


def refuse_device(path: Path) -> None:
    """Raise `OSError` where the path is missing, or a device; files, folders and pipes pass."""
    mode = path.stat().st_mode
    if stat.S_ISCHR(mode) or stat.S_ISBLK(mode):
        raise OSError(errno.EINVAL, "it is a device; needed is a file")
