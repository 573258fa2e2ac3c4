"""Progress on standard error, for everything that takes more than about two seconds.

A terminal shows bars. Elsewhere, as in the log of a job, there are a few lines: the first after
`FIRST_LINE` seconds, so that quick commands are silent, and then one in `BETWEEN_LINES` seconds.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.progress import Progress

#: Seconds before the first line, and between two lines, where standard error is no terminal.
FIRST_LINE, BETWEEN_LINES = 2.0, 20.0


@contextmanager
def progress_bar(text: str, total: int | None) -> Iterator[Callable[[int], None]]:
    """A function of the number of items done, which draws a bar, or prints a line at times."""
    if not sys.stderr.isatty():
        yield _lines(text, total)
        return
    with _bars(counted=total is not None, transient=True) as progress:
        task = progress.add_task(text, total=total)
        yield lambda done: progress.update(task, completed=done)


@contextmanager
def working(text: str) -> Iterator[None]:
    """A bar that moves, with the time, for work whose share done is not known; or one line."""
    if sys.stderr.isatty():
        with progress_bar(text, None):
            yield
        return
    line = threading.Timer(FIRST_LINE, _say, [f"{text} ..."])
    line.daemon = True
    line.start()
    try:
        yield
    finally:
        line.cancel()


@contextmanager
def stage_progress() -> Iterator[Callable[[str, int, int], None]]:
    """A function (stage, done, total): a bar for each stage on a terminal, otherwise lines."""
    if not sys.stderr.isatty():
        stages: dict[str, Callable[[int], None]] = {}
        started = time.monotonic()

        def announce(text: str, done: int, total: int) -> None:
            if text not in stages:
                stages[text] = _lines(text, total, BETWEEN_LINES)
                if time.monotonic() > started + FIRST_LINE:
                    _say(f"{text} ...")
            stages[text](done)

        yield announce
        return
    tasks: dict[str, Any] = {}
    with _bars(counted=False, transient=False) as progress:

        def update(text: str, done: int, total: int) -> None:
            if text not in tasks:
                tasks[text] = progress.add_task(text, total=total)
            progress.update(tasks[text], completed=done, total=total)

        yield update


def _bars(*, counted: bool, transient: bool) -> Progress:
    """Bars on a terminal, with or without the numbers of items."""
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        *([TextColumn("{task.completed}/{task.total}")] if counted else []),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        console=Console(stderr=True),
        transient=transient,
    )


def _lines(text: str, total: int | None, first: float | None = None) -> Callable[[int], None]:
    """A function of the number of items done that prints a line where it is time for one."""
    started = time.monotonic()
    due = started + (FIRST_LINE if first is None else first)

    def tell(done: int) -> None:
        nonlocal due
        now = time.monotonic()
        if now < due or (total is not None and done >= total):
            return
        due = now + BETWEEN_LINES
        if not total:
            _say(f"{text} ...")
            return
        left = f", about {_duration((now - started) * (total - done) / done)} left" if done else ""
        _say(f"{text}: {100 * done // total} %{left}")

    return tell


def _duration(seconds: float) -> str:
    """Such as 40 s, or 3 min."""
    return f"{seconds:.0f} s" if seconds < 90.0 else f"{seconds / 60.0:.0f} min"


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)
