"""The command `soilml` and its sub-commands."""

from __future__ import annotations

import argparse
import importlib
import re
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from typing import Any, NoReturn

from soilml import __version__
from soilml.cli.old_spellings import present_words
from soilml.cli.options import declare, declared_outputs, input_files, need_for_options
from soilml.cli.process import (
    StopSignals,
    Terminated,
    check_memory_limit,
    fail,
    reserve_standard_descriptors,
    silence_stdout,
)
from soilml.cli.screen import SCREEN
from soilml.errors import InputError, SoilmlError, did_you_mean
from soilml.io.atomic_files import check_outputs, clear_interrupted, replaced

DESCRIPTION = """\
Estimate the soil under a rover: from slip, torque and load to cohesion,
friction angle and shear modulus, each with its uncertainty.
"""
EPILOG = "`soilml COMMAND --help` explains one command with an example."
_OWN, _GROUND = "soilml.cli.commands.", "training.commands."

#: Commands by section of the list: the module of each, and what the list says.
SECTIONS: dict[str, dict[str, tuple[str, str]]] = {
    "Start": {
        "example": (_OWN + "example", "files to try the commands with"),
        "init": (_OWN + "init", "a first model file: wheel, soil, priors, noise"),
        "serve": ("soilml.serve.command", "all of this in the browser"),
        "show": (_OWN + "show", "published soils, effects, trained files; or one of them"),
        "setup check": (_OWN + "doctor", "libraries, trained files, output of this installation"),
        "setup completion": (_OWN + "completion", "completion for bash, zsh or fish"),
    },
    "Data": {
        "import": (_OWN + "import_", "logs of a rig or a rover become a table of runs"),
        "simulate": (_OWN + "simulate", "readings on one soil, at slips and loads that you name"),
        "generate": ("datagen.commands.generate", "training data: many random soils by a recipe"),
    },
    "Soil": {
        "identify": (_OWN + "identify", "soil from runs: fits the equations of MODEL.toml"),
        "estimate": (_OWN + "estimate", "soil from runs: a trained MODEL.onnx, as on board"),
        "bevameter": (_OWN + "bevameter", "soil from plate and shear tests, without a wheel"),
    },
    "Model": {
        "gap": (_OWN + "gap", "does the model fit the runs, and what does it lack?"),
        "adapt": (_GROUND + "adapt", "a trained file on the model that the runs corrected"),
        "train": (_GROUND + "train", "a trained file from data"),
        "compare": (_GROUND + "compare", "score trained files and fits on known soils"),
        "export c": (_GROUND + "export_c", "a trained file as C99 code"),
        "export slip": (_GROUND + "export_slip", "the slip filter of a rover as ONNX and C99"),
        "export soil": (_OWN + "export_soil", "a soil for Chrono, Gazebo or a table"),
    },
    "Rover": {
        "pull": (_OWN + "pull", "drawbar pull, and the steepest slope that can be climbed"),
        "drive slip": (_OWN + "slip", "slip without odometry, from torque and pitch"),
        "drive map": (_OWN + "map_", "the soil along a drive, and slopes that can be climbed"),
        "plan next": (_OWN + "advise", "the row to measure next on a given soil"),
        "plan effects": (_OWN + "audit", "effects that planned runs could identify"),
        "plan wheels": (_OWN + "design", "wheels to build for a given slope"),
        "plan runs": (_OWN + "design_runs", "runs of your own simulator"),
    },
    "Papers": {
        "paper climb": (_OWN + "climb", "steepest slope of a rover with force-sensor wheels"),
        "paper sensor-wheel": (_OWN + "sensor_wheel", "pull of a wheel from the stress on its rim"),
        "paper wheel-leg": (
            _OWN + "wheel_leg",
            "soil and traffic class from strides of a wheel-leg",
        ),
        "paper walk": (_OWN + "walk", "simulated walks of wheel-legs"),
        "paper track": (_OWN + "track", "soil and belt of a tracked robot from a log of pulls"),
        "paper numbers": (_OWN + "papers", "printed numbers beside the computed ones"),
    },
}
#: Module of each command.
COMMANDS = {name: entry[0] for own in SECTIONS.values() for name, entry in own.items()}
#: What the list says of commands of two words.
GROUPS = {
    "setup": "this installation",
    "export": "files for a board or a simulator",
    "drive": "along a drive",
    "plan": "what to measure or build next",
    "paper": "of the papers",
}
_WRONG_COMMAND = re.compile(r"argument COMMAND: invalid choice: '(.*)' \(choose from (.*)\)")
_UNKNOWN_OPTION = re.compile(r"unrecognized arguments: (?:[^-].*? )?(--?[\w-]+)")


class _Parser(argparse.ArgumentParser):
    """Reports an error in one line, which names the help.

    `known` are the options of the command that was asked for.
    """

    known: Sequence[str] = ()

    def __init__(self, *words: Any, **options: Any) -> None:
        super().__init__(*words, **options)
        self._negative_number_matcher = re.compile(r"-[\d.]")  # -0.3:0.6:10 is a value

    def error(self, message: str) -> NoReturn:
        wrong = _WRONG_COMMAND.fullmatch(message)
        if wrong is not None:
            names = re.findall(r"[\w-]+", wrong[2])
            near = did_you_mean(wrong[1], names)
            message = f"no command {wrong[1]!r}; {near}there are: {', '.join(names)}"
        if message.endswith("required: COMMAND"):
            below = next(a.choices for a in self._actions if a.metavar == "COMMAND")
            message = f"needed is one of: {', '.join(below or ())}"
        if unknown := _UNKNOWN_OPTION.search(message):
            near = did_you_mean(unknown[1], self.known).removesuffix(" ")
            message += f"; {near}" if near else ""
        self.exit(fail(f"{message} (see {self.prog} --help)", 2, self.prog))

    def _print_message(self, message: str, file: Any = None) -> None:
        """Print help and version; argparse itself passes over a stream that cannot be written."""
        if message and (stream := file or sys.stderr) is not None:
            stream.write(message)
            stream.flush()


def parser(words: Sequence[str] | None = None) -> argparse.ArgumentParser:
    """The parser of the command line.

    words: The command line. The module of its command alone is imported, and its arguments are
        declared; those of all commands where None.
    """
    layout: Any = argparse.RawDescriptionHelpFormatter
    chosen = None if words is None else _command_of(words)
    listed = "\n".join([DESCRIPTION, *_list()])
    usage = "soilml COMMAND ... [--help] [--version]"
    root = _Parser("soilml", usage, listed, EPILOG, formatter_class=layout)
    root.add_argument("--version", action="version", version=f"soilml {__version__}")
    required: dict[str, Any] = {"metavar": "COMMAND", "required": True}
    commands = root.add_subparsers(prog="soilml", help=argparse.SUPPRESS, **required)
    groups: dict[str, Any] = {}
    known = {name: entry for own in SECTIONS.values() for name, entry in own.items()}
    for name, (path, said) in known.items():
        group, _, word = name.rpartition(" ")
        if group and group not in groups:
            text = f"{GROUPS[group][0].upper()}{GROUPS[group][1:]}."
            made = commands.add_parser(group, help=GROUPS[group], description=text)
            groups[group] = made.add_subparsers(**required)
        into = groups[group] if group else commands
        if words is not None and name != chosen:
            into.add_parser(word, help=said)
            continue
        module = importlib.import_module(path)
        about = module.DESCRIPTION
        sub = into.add_parser(word, help=said, description=about, formatter_class=layout)
        declare(sub, (*module.ARGUMENTS, "screen"))
        if formats := getattr(module, "FORMATS", ()):
            text = "form of the result on standard output (default: table)"
            sub.add_argument("--format", choices=formats, help=text)
        if words is not None:
            root.known = [option for option in sub._option_string_actions if len(option) > 2]
            root.prog = sub.prog
        outputs = getattr(module, "outputs", declared_outputs)
        sub.set_defaults(run=module.run, outputs=outputs, command=name)
    return root


def _command_of(words: Sequence[str]) -> str:
    """The command that a command line begins with; empty where it begins with none."""
    return next((" ".join(words[:n]) for n in (1, 2) if " ".join(words[:n]) in COMMANDS), "")


def _list() -> Iterator[str]:
    """The lines of the list of commands; a group is one line."""
    for title, own in SECTIONS.items():
        seen: dict[str, str] = {}
        for name, (_, text) in own.items():
            group, _, word = name.rpartition(" ")
            if not group:
                seen[name] = text
                continue
            before = seen.get(group, "").partition(":")[0]
            seen[group] = f"{before}{', ' if before else ''}{word}: {GROUPS[group]}"
        yield f"{title}:"
        yield from (f"  {name:<10} {text}" for name, text in seen.items())


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command of `soilml`.

    arguments: The words after `soilml`; those of the process where None.

    Returns: Exit status: 0 for success, 2 with one line on standard error for bad input, 128 and
    the number of the signal for a signal that asks the process to stop. `papers` gives 1 where a
    number is not reproduced, `gap` 3 where the data cannot be analysed (`bad-data`). An
    output file is complete or absent in every case.
    """
    try:
        with StopSignals() as signals:
            status = _run(arguments, signals)
    except (KeyboardInterrupt, Terminated) as stop:  # while the data of the command were freed
        status = _interrupted(stop)
    if arguments is None and threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # the process ends; all is said
    return status


def _run(arguments: Sequence[str] | None, signals: StopSignals) -> int:
    """Run one command; exceptions become one line on standard error."""
    reserve_standard_descriptors()
    replaced.clear()
    try:
        try:
            return _status(list(sys.argv[1:] if arguments is None else arguments))
        except Exception:
            if signals.raised is not None:  # an import or a class has turned it into another one
                raise signals.raised from None
            raise
    except SoilmlError as error:
        return fail(str(error), 2)
    except (KeyboardInterrupt, Terminated) as stop:
        return _interrupted(stop)
    except SystemExit as done:  # the parser has printed the help, or why it refuses an argument
        return int(done.code or 0)
    except BrokenPipeError:
        silence_stdout()
        return 0
    except OSError as error:
        if error.filename is None:
            silence_stdout()
        what = error.filename or "standard output"
        return fail(f"{what} cannot be read or written: {error.strerror or error}", 2)
    except UnicodeEncodeError as error:
        odd = error.object[error.start : error.end]
        names = all("\udc80" <= c <= "\udcff" for c in odd)  # bytes of a name that is not UTF-8
        hint = "rename it" if names else "set PYTHONIOENCODING=utf-8, or rename it"
        return fail(f"{odd!a} cannot be written as {error.encoding}: {hint}", 2)
    except MemoryError:
        return fail("this machine has too little memory for the command: ask for fewer rows", 2)


def _status(words: list[str]) -> int:
    """Run the command of these words; returns the exit status."""
    typed = words or ["--help"]
    words = present_words(typed)
    if empty := [word for word in words if word.startswith("--") and word.endswith("=--")]:
        raise InputError(f"{empty[0]}: needed is a value after the equals sign")
    args = parser(words).parse_args(words)
    args.command_line, args.make_parser = typed, parser
    SCREEN.choose(getattr(args, "format", None), args.quiet, args.verbose)
    check_outputs(args.outputs(args), input_files(args))
    check_memory_limit()
    need_for_options(args, args.command)
    status = int(args.run(args) or 0)
    if sys.stdout is not None:
        sys.stdout.flush()
    return status


def _interrupted(stop: KeyboardInterrupt | Terminated) -> int:
    """Say that a signal stopped the command, and what was complete; returns the exit status."""
    clear_interrupted()
    code = stop.code if isinstance(stop, Terminated) else 128 + signal.SIGINT
    written = f"complete before that: {', '.join(replaced)}" if replaced else ""
    said = getattr(stop, "said", f"interrupted; {written or 'no output was written'}")
    return fail(said, int(code or 0))
