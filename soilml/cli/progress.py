"""Progress bars on standard error, for anything over two seconds."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def bar(text: str, total: int) -> Iterator[Callable[[int], None]]:
    """A bar that is told how much is done so far; silent where nobody looks."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    console = Console(stderr=True)
    if not sys.stderr.isatty():
        yield lambda done: None
        return
    shown = Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed}/{task.total}"),
        TimeElapsedColumn(),
        console=console,
        transient=True,
    )
    with shown:
        task = shown.add_task(text, total=total)
        yield lambda done: shown.update(task, completed=done)


@contextmanager
def stages() -> Iterator[Callable[[str, int, int], None]]:
    """A line for each named stage, told (name, done, total); plain lines where nobody looks."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    if not sys.stderr.isatty():
        seen: set[str] = set()

        def say(text: str, done: int, total: int) -> None:
            if text not in seen:
                seen.add(text)
                print(f"{text} ...", file=sys.stderr, flush=True)

        yield say
        return
    shown = Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TimeElapsedColumn(),
        console=Console(stderr=True),
    )
    tasks: dict[str, object] = {}
    with shown:

        def step(text: str, done: int, total: int) -> None:
            if text not in tasks:
                tasks[text] = shown.add_task(text, total=total)
            shown.update(tasks[text], completed=done, total=total)  # type: ignore[arg-type]

        yield step
