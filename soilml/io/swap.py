"""A set of files replaced as one, also where the process is stopped or killed meanwhile.

While files are written and replaced, a journal `.NAME.RANDOM.journal` lies beside the first of
them. It names all, and it is locked, so that another process can tell whether its writer is alive.
After a process was killed, the next one that writes the same files reads the journal: temporary
files that were complete take their places, incomplete ones are removed.
"""

from __future__ import annotations

import json
import os
import signal
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import IO, Any

try:
    import fcntl
except ImportError:  # not on every system: nothing is cleared there
    fcntl = None  # type: ignore[assignment]

#: Names of outputs that this process has replaced, in order.
replaced: list[str] = []
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
        self._journal = _journal_name(self.targets[0], token)
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

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
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
        for journal in target.parent.glob(_journal_pattern(target)):
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


def _journal_name(target: Path, token: str) -> Path:
    return target.parent / f".{target.name[:40]}.{token}.journal"


def _journal_pattern(target: Path) -> str:
    escaped = "".join(f"[{c}]" if c in "*?[" else c for c in target.name[:40])
    return f".{escaped}.{'[0-9a-f]' * 8}.journal"


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
