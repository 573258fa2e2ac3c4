"""The command `soilml`, whose sub-commands are found by entry points."""

from __future__ import annotations

import argparse
import io
import os
import re
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib.metadata import entry_points
from typing import Any, NoReturn

from soilml import __version__
from soilml.errors import SoilmlError
from soilml.io.atomic_files import check_apart

DESCRIPTION = """\
What soil does the rover drive on? From slip, torque and load to cohesion, friction angle and
shear modulus, with an uncertainty that can be believed.

  from a model to data        soilml simulate, generate
  from data to a flying file  soilml train
  from measurements to soil   soilml estimate (trained, on board), identify (analytic)
  which to believe            soilml compare
  what slope can be climbed   soilml pull (by measured rows), climb (by stress on the rims)
"""
EPILOG = "`soilml COMMAND --help` explains one command with an example."
ORDER = (
    "soils",
    "effects",
    "simulate",
    "identify",
    "audit",
    "gap",
    "generate",
    "train",
    "estimate",
    "advise",
    "pull",
    "compare",
    "climb",
)
#: Arguments that name files to write.
WRITTEN = ("out", "picture")
_NEGATIVE = re.compile(r"-[\d.]")


class _Stopped(SystemExit):
    """A signal asked to stop."""


class _Parser(argparse.ArgumentParser):
    """Says in one line what is wrong and where help is."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: {message} (see {self.prog} --help)\n")


def parser() -> argparse.ArgumentParser:
    """The whole command line."""
    layout: Any = argparse.RawDescriptionHelpFormatter
    root = _Parser("soilml", description=DESCRIPTION, epilog=EPILOG, formatter_class=layout)
    root.add_argument("--version", action="version", version=f"soilml {__version__}")
    commands = root.add_subparsers(metavar="COMMAND", required=True)
    found = {entry.name: entry for entry in entry_points(group="soilml.commands")}
    for name in sorted(found, key=lambda n: (ORDER.index(n) if n in ORDER else 99, n)):
        module = found[name].load()
        sub = commands.add_parser(
            name,
            help=module.HELP,
            description=module.DESCRIPTION,
            formatter_class=layout,
        )
        module.add(sub)
        sub.set_defaults(run=module.run, outputs=getattr(module, "outputs", _no_outputs))
    return root


def _no_outputs(args: argparse.Namespace) -> list[Any]:
    return []


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; 0 when it ran, 2 with one line on standard error for bad input.

    A signal that asks to stop ends it with 128 and the signal's number, and nothing half-written.
    """
    _hold_descriptors()
    given = _joined(list(sys.argv[1:] if arguments is None else arguments))
    args = parser().parse_args(given)
    try:
        with _stoppable():
            check_apart(args.outputs(args), _files(args))
            status = int(args.run(args) or 0)
            if sys.stdout is not None:
                sys.stdout.flush()
            return status
    except SoilmlError as error:
        return _said(str(error), 2)
    except (KeyboardInterrupt, _Stopped) as stop:
        code = stop.code if isinstance(stop, _Stopped) else 128 + signal.SIGINT
        return _said("interrupted; nothing half-written was left", int(code or 0))
    except BrokenPipeError:
        _silence_output()
        return 0
    except OSError as error:
        if error.filename is None:
            _silence_output()
        what = error.filename or "standard output"
        return _said(f"{what} cannot be read or written: {error.strerror or error}", 2)
    except UnicodeEncodeError as error:
        odd = error.object[error.start : error.end]
        hint = "set PYTHONIOENCODING=utf-8, or rename it"
        return _said(f"{odd!a} cannot be written as {error.encoding}: {hint}", 2)
    except MemoryError:
        return _said("the memory of this machine is too small for it: ask for fewer rows", 2)


def _said(text: str, status: int) -> int:
    """Say one line on standard error; the status."""
    print(f"soilml: {' '.join(text.split())}", file=sys.stderr)
    return status


def _hold_descriptors() -> None:
    """Take the numbers of closed standard streams, so that no file gets what is said to them."""
    with suppress(OSError):
        while (descriptor := os.open(os.devnull, os.O_RDWR)) < 3:
            pass
        os.close(descriptor)
    if sys.stderr is None:
        sys.stderr = io.StringIO()  # print(file=None) would go to the output


def _silence_output() -> None:
    """Let nothing more go to a standard output that takes nothing, not even what waits in it."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _files(args: argparse.Namespace) -> list[str]:
    """Every argument that may name a file to read."""
    given = (v if isinstance(v, list) else [v] for k, v in vars(args).items() if k not in WRITTEN)
    return [value for values in given for value in values if isinstance(value, str)]


@contextmanager
def _stoppable() -> Iterator[None]:
    """Inside, the signals that end a process raise, so that what was begun is cleared away."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(number: int, frame: Any) -> NoReturn:
        signal.signal(number, signal.SIG_IGN)
        raise _Stopped(128 + number)

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


def _joined(words: list[str]) -> list[str]:
    """`--slip -0.3:0.6:10` as one word, which argparse would take for two options."""
    joined: list[str] = []
    for word in words:
        if joined and joined[-1] in ("--slip", "--load", "--slips") and _NEGATIVE.match(word):
            joined[-1] += f"={word}"
        else:
            joined.append(word)
    return joined
