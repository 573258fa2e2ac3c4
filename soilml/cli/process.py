"""The process around a command: standard streams, signals, and pipes that are closed early."""

from __future__ import annotations

import io
import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any, NoReturn


class Terminated(SystemExit):
    """A signal asked the process to stop; the exit status is 128 and the signal's number."""


def fail(text: str, status: int) -> int:
    """Print `text` as one line on standard error; returns the exit status."""
    print(f"soilml: {' '.join(text.split())}", file=sys.stderr)
    return status


def reserve_standard_descriptors() -> None:
    """Open the null device for closed standard streams.

    Otherwise the first file that is opened would get descriptor 1 or 2, and receive what is
    printed.
    """
    with suppress(OSError):
        while (descriptor := os.open(os.devnull, os.O_RDWR)) < 3:
            pass
        os.close(descriptor)
    if sys.stderr is None:
        sys.stderr = io.StringIO()  # print(file=None) would write to standard output


def silence_stdout() -> None:
    """Redirect standard output to the null device, so that flushing it cannot fail again."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


@contextmanager
def termination_as_exception() -> Iterator[None]:
    """Inside, SIGTERM and SIGHUP raise `Terminated`, so that temporary files are removed.

    A handler that the program has set already stays, and other threads change nothing.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(number: int, frame: Any) -> NoReturn:
        signal.signal(number, signal.SIG_IGN)
        raise Terminated(128 + number)

    numbers = [getattr(signal, name, None) for name in ("SIGTERM", "SIGHUP")]
    before = {n: signal.getsignal(n) for n in numbers if n is not None}
    for number, handler in before.items():
        if handler is signal.SIG_DFL:
            signal.signal(number, stop)
    try:
        yield
    finally:
        for number, handler in before.items():
            if handler is signal.SIG_DFL:
                signal.signal(number, handler)
