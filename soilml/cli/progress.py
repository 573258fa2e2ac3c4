"""Progress on standard error, for everything that takes more than about two seconds."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def progress_bar(text: str, total: int | None) -> Iterator[Callable[[int], None]]:
    """A function of the number of items done, which draws a bar where stderr is a terminal."""
    if not sys.stderr.isatty():
        yield lambda done: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    progress = Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        *([] if total is None else [TextColumn("{task.completed}/{task.total}")]),
        TimeElapsedColumn(),
        console=Console(stderr=True),
        transient=True,
    )
    with progress:
        task = progress.add_task(text, total=total)
        yield lambda done: progress.update(task, completed=done)


@contextmanager
def working(text: str) -> Iterator[None]:
    """A bar that moves, with the time, for work whose share done is not known."""
    with progress_bar(text, None):
        yield


@contextmanager
def stage_progress() -> Iterator[Callable[[str, int, int], None]]:
    """A function (stage, done, total): a bar for each stage on a terminal, otherwise a line."""
    if not sys.stderr.isatty():
        started: set[str] = set()

        def announce(text: str, done: int, total: int) -> None:
            if text not in started:
                started.add(text)
                print(f"{text} ...", file=sys.stderr, flush=True)

        yield announce
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    progress = Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TimeElapsedColumn(),
        console=Console(stderr=True),
    )
    tasks: dict[str, object] = {}
    with progress:

        def update(text: str, done: int, total: int) -> None:
            if text not in tasks:
                tasks[text] = progress.add_task(text, total=total)
            progress.update(tasks[text], completed=done, total=total)  # type: ignore[arg-type]

        yield update
