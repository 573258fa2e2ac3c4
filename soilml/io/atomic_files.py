"""Output files, written atomically as sets, also where the process is stopped or killed.

While files are written and replaced, a journal `.NAME.RANDOM.journal` lies beside the first of
them. It names all, and it is locked, so that another process can tell whether its writer is alive.
After a process was killed, the next one that writes the same files reads the journal: temporary
files that were complete take their places, incomplete ones are removed.
"""

from __future__ import annotations

import errno
import glob
import json
import os
import signal
import stat
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import IO, Any

from soilml.errors import InputError
from soilml.io.cell_text import one_line

try:
    import fcntl
except ImportError:  # not on every system: nothing is cleared there
    fcntl = None  # type: ignore[assignment]

replaced: list[str] = []  # Names of outputs that this process has replaced, in order
#: Last line of a journal whose files are all complete.
_COMPLETE = "complete\n"
_SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP")
#: Swaps of this process by their journals, whose locks it would not notice.
_own: dict[Path, Swap] = {}


class Swap:
    """Temporary files `parts` for the files `targets`, and files to remove with the exchange."""

    def __init__(self, targets: Sequence[Path], remove: Sequence[Path] = ()) -> None:
        token = os.urandom(4).hex()
        self.targets, self.remove = list(targets), list(remove)
        self.parts = [t.parent / f".{t.name[:40]}.{token}.part" for t in self.targets]
        first = self.targets[0]
        self._journal = first.parent / f".{first.name[:40]}.{token}.journal"
        self._opened: IO[str] | None = None

    def __enter__(self) -> Swap:
        _own[self._journal] = self
        self._opened = self._journal.open("x", encoding="utf-8")
        if fcntl is not None:
            with suppress(OSError):  # a file system without locks
                fcntl.lockf(self._opened, fcntl.LOCK_EX | fcntl.LOCK_NB)
        moves = [[str(p), str(t)] for p, t in zip(self.parts, self.targets, strict=True)]
        try:
            remove = [str(path) for path in self.remove]
            self._write(json.dumps({"moves": moves, "remove": remove}) + "\n")
        except BaseException:  # a disk without room for a line
            self.clear()
            raise
        return self

    def __exit__(self, *raised: object) -> None:
        self.clear()

    def clear(self) -> None:
        """Remove what is left of the temporary files, and the journal."""
        try:
            for part in self.parts:
                part.unlink(missing_ok=True)
        finally:
            self._journal.unlink(missing_ok=True)
            if self._opened is not None:
                with suppress(OSError):
                    self._opened.close()
            _own.pop(self._journal, None)

    def replace_all(self, names: str) -> None:
        """Put every temporary file in its place; a signal to stop waits, and then says so."""
        with _signals_after(f"interrupted; complete before that: {names}"):
            self._write(_COMPLETE)
            _exchange(list(zip(self.parts, self.targets, strict=True)), self.remove)
            if not any(target.suffix == ".part" for target in self.targets):
                replaced.append(names)

    def _write(self, text: str) -> None:
        assert self._opened is not None
        self._opened.write(text)
        self._opened.flush()
        os.fsync(self._opened.fileno())


def is_writing() -> bool:
    """Whether this process has temporary files."""
    return bool(_own)


def clear_interrupted() -> None:
    """Clear what this process left where a signal arrived as a swap began or ended."""
    for swap in list(_own.values()):
        with suppress(OSError):
            swap.clear()


def finish_interrupted(targets: Sequence[Path]) -> None:
    """Finish or clear what killed processes left of writing these files."""
    if fcntl is None:
        return
    for target in targets:
        pattern = f".{glob.escape(target.name[:40])}.{'[0-9a-f]' * 8}.journal"
        for journal in target.parent.glob(pattern):
            if journal not in _own:
                with suppress(OSError, ValueError, KeyError, TypeError):
                    _finish(journal, {target.parent for target in targets})


def _finish(journal: Path, folders: set[Path]) -> None:
    """Finish or clear what one journal names, if that lies in these folders."""
    with journal.open("r+", encoding="utf-8") as opened:
        fcntl.lockf(opened, fcntl.LOCK_EX | fcntl.LOCK_NB)  # OSError where its writer is alive
        first, *rest = opened.readlines() or [""]
        content: dict[str, Any] = json.loads(first) if first else {"moves": [], "remove": []}
        moves = [(Path(part), Path(target)) for part, target in content["moves"]]
        remove = [Path(path) for path in content["remove"]]
        if any(path.parent not in folders for path in remove) or not all(
            part.parent == target.parent
            and target.parent in folders
            and part.name.startswith(f".{target.name[:40]}.")
            and part.suffix == ".part"
            for part, target in moves
        ):
            return  # no journal of ours
        if rest == [_COMPLETE]:
            _exchange([(part, target) for part, target in moves if part.exists()], remove)
        for part, _ in moves:
            finish_interrupted([part])  # a function that writes a file wrote this one
            part.unlink(missing_ok=True)
        journal.unlink(missing_ok=True)


def _exchange(moves: Sequence[tuple[Path, Path]], remove: Sequence[Path]) -> None:
    for part, target in moves:
        part.replace(target)
    for path in remove:
        path.unlink(missing_ok=True)


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
    Then all are replaced: a signal waits until they are, and what a killed process left is finished
    or cleared by the next one that writes the same files. Files of an earlier set that the new one
    does not have are in `remove`. A temporary file lies in the folder of its
    target as `.NAME.RANDOM.part`, so that two processes do not share one. A file that is replaced
    keeps its permissions.

    Raises `InputError` as `check_writable` does, and where the disk is full.
    """
    if not paths:
        yield []
        return
    targets = [check_writable(path) for path in paths]
    names = ", ".join(str(path) for path in paths)
    try:
        finish_interrupted(targets)
        with Swap(targets, [Path(os.path.realpath(path)) for path in remove]) as swap:
            yield swap.parts
            for part, target in zip(swap.parts, targets, strict=True):
                with part.open("rb+") as written:
                    if (kind := _kind(target)) is not None:
                        os.fchmod(written.fileno(), stat.S_IMODE(kind))
                    os.fsync(written.fileno())
            for path in paths:
                check_writable(path)  # it may have changed since the first check
            swap.replace_all(names)
    except OSError as error:
        raise InputError(f"{names} cannot be written: {_why(error)}") from error


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
