"""Progress on standard error, for everything that takes more than about two seconds.

It is one line. A terminal shows it redrawn, and without it when the work is done. Elsewhere, as in
the log of a job, it is printed: first after `FIRST_LINE` seconds, so that quick commands are
silent, and then once in `BETWEEN_LINES` seconds. With -q there is none.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from soilml.cli.screen import SCREEN

#: Seconds before the first line, and between two lines; the latter on a terminal.
FIRST_LINE, BETWEEN_LINES, BETWEEN_DRAWN = 2.0, 20.0, 0.2
_ERASE = "\r\033[K"  # To the beginning of the line, which is blank then


@contextmanager
def progress_bar(text: str, total: int | None) -> Iterator[Callable[[int], None]]:
    """A function of the number of items done, of `total` or of a number that is not known."""
    with stage_progress() as stages:
        yield lambda done: stages(text, done, total or 0)


@contextmanager
def working(text: str) -> Iterator[None]:
    """The same for work whose share done is not known: one line."""
    with stage_progress() as stages:
        line = threading.Timer(FIRST_LINE, stages, [text, 0, 0])
        line.daemon = True
        line.start()
        try:
            yield
        finally:
            line.cancel()


@contextmanager
def stage_progress() -> Iterator[Callable[[str, int, int], None]]:
    """A function (stage, done, total) for work in stages; a total of 0 is not known."""
    started = shown = time.monotonic()
    stage, begun = "", started

    def say(text: str, done: int, total: int) -> None:
        nonlocal stage, begun, shown
        now = time.monotonic()
        is_new = text != stage
        if is_new:
            stage, begun = text, now if stage else started
        if SCREEN.quiet or now < started + FIRST_LINE or (0 < total <= done):
            return
        drawn = sys.stderr.isatty()
        between = BETWEEN_DRAWN if drawn else BETWEEN_LINES
        if not is_new and shown > started and now < shown + between:
            return
        shown = now
        line = f"{text} ..."
        if total and done:
            left = _duration((now - begun) * (total - done) / done)
            line = f"{text}: {100 * done // total} %, about {left} left"
        print(f"{_ERASE}{line}" if drawn else line, end="" if drawn else "\n", file=sys.stderr)
        sys.stderr.flush()

    try:
        yield say
    finally:
        if shown > started and sys.stderr.isatty():
            with suppress(OSError):
                print(_ERASE, end="", file=sys.stderr, flush=True)


def _duration(seconds: float) -> str:
    """Such as 40 s, or 3 min."""
    return f"{seconds:.0f} s" if seconds < 90.0 else f"{seconds / 60.0:.0f} min"
