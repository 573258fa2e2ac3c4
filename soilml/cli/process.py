"""The process around a command: standard streams, and signals from the first import on.

A signal handler that raises an exception is not enough: raised inside the import of a library, the
exception turns into another one, is lost, or ends the process in its C++ code. While a module is
imported and no output is being written, nothing is half-written yet, and the process just ends.
"""

from __future__ import annotations

import os
import signal
import sys

TYPE_CHECKING = False  # this module is the first of the command line: it imports little
if TYPE_CHECKING:
    from types import FrameType
    from typing import Any, NoReturn


#: Address space that the numerical libraries reserve, bytes: at all, and for each core.
_LEAST_MEMORY, _MEMORY_PER_CORE = 512 << 20, 48 << 20


class Terminated(SystemExit):
    """A signal asked the process to stop; the exit status is 128 and the signal's number."""


class StopSignals:
    """Inside, Ctrl-C, SIGTERM and SIGHUP raise an exception, or end the process in an import.

    Ctrl-C raises `KeyboardInterrupt` and the others `Terminated`, so that temporary files are
    removed. A handler that the program has set already stays, and other threads change nothing.
    `raised` is the exception that was raised, or None.
    """

    raised: KeyboardInterrupt | Terminated | None = None

    def __enter__(self) -> StopSignals:
        self._before: dict[int, Any] = {}
        for name in ("SIGINT", "SIGTERM", "SIGHUP"):
            number = getattr(signal, name, None)
            usual = (signal.SIG_DFL, signal.default_int_handler)
            if number is not None and (handler := signal.getsignal(number)) in usual:
                try:
                    signal.signal(number, self._stop)
                except ValueError:  # another thread than the main one
                    break
                self._before[number] = handler
        return self

    def __exit__(self, *raised: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _stop(self, number: int, frame: FrameType | None) -> NoReturn:
        if _is_importing(frame):
            try:
                os.write(2, b"soilml: interrupted; no output was written\n")
            finally:
                os._exit(128 + number)
        if number == signal.SIGINT:
            self.raised = KeyboardInterrupt()
        else:
            signal.signal(number, signal.SIG_IGN)
            self.raised = Terminated(128 + number)
        raise self.raised


def _is_importing(frame: FrameType | None) -> bool:
    """Whether a module is being imported, and no output is being written."""
    swap = sys.modules.get("soilml.io.atomic_files")
    if getattr(swap, "is_writing", bool)() or getattr(swap, "replaced", ()):
        return False
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
        frame = frame.f_back
    return False


def fail(text: str, status: int, program: str = "soilml") -> int:
    """Print `text` as one line on standard error; returns the exit status."""
    from contextlib import suppress

    from soilml.errors import shortened
    from soilml.io.cell_text import escaped

    try:
        print(f"{program}: {shortened(' '.join(escaped(text).split()))}", file=sys.stderr)
    except OSError:  # a full device: the status says what the line cannot
        with suppress(OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stderr.fileno())
    return status


def reserve_standard_descriptors() -> None:
    """Open the null device for closed standard streams.

    Otherwise the first file that is opened would get descriptor 1 or 2, and receive what is
    printed.
    """
    from contextlib import suppress

    with suppress(OSError):
        while (descriptor := os.open(os.devnull, os.O_RDWR)) < 3:
            pass
        os.close(descriptor)
    if sys.stderr is None:
        import io

        sys.stderr = io.StringIO()  # print(file=None) would write to standard output


def silence_stdout() -> None:
    """Redirect standard output to the null device, so that flushing it cannot fail again."""
    from contextlib import suppress

    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def check_memory_limit() -> None:
    """Raise `InputError` where a limit of the process leaves the numerical libraries too little.

    They ask for memory again and again where they get none, deaf to every signal.
    """
    try:
        import resource
    except ImportError:  # not on every system
        return
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    needed = _LEAST_MEMORY + _MEMORY_PER_CORE * (os.cpu_count() or 1)
    if limit != resource.RLIM_INFINITY and limit < needed:
        from soilml.errors import InputError

        raise InputError(
            f"this process may use {limit >> 20} MB of memory; needed are {needed >> 20} MB: "
            "raise the limit (ulimit -v)"
        )
