"""The command `soilml` and its sub-commands."""

from __future__ import annotations

import argparse
import importlib
import re
import signal
import sys
import threading
from collections.abc import Sequence
from typing import Any, NoReturn

from soilml import __version__
from soilml.cli.options import add_screen_options, declared_outputs, input_files, need_for_options
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

  files to try it with         soilml example
  all of it in the browser     soilml serve
  from a log to a table        soilml import
  from a model to data         soilml simulate, generate
  from data to a model file    soilml train
  from a model file to C       soilml export c, export fusion
  to a graph of fixed shapes   soilml export step
  the slip filter for a board  soilml export slip
  from a campaign to a file    soilml adapt
  from measurements to soil    soilml estimate (trained model, as on board)
                               soilml identify (analytic methods)
                               soilml bevameter (plate and shear tests)
  what the model lacks         soilml gap
  what to measure next         soilml plan next, plan effects
  runs of your own simulator   soilml plan runs
  from soil to a simulator     soilml export soil
  comparison of methods        soilml compare
  slopes that can be climbed   soilml pull
  wheels for a slope           soilml design
  slip without odometry        soilml slip
  soil along a drive as a map  soilml map
  systems of the papers        soilml paper climb, sensor-wheel, wheel-leg, walk, track
"""
EPILOG = "`soilml COMMAND --help` explains one command with an example."

#: The commands of this distribution, in the order of the help text; they are present where the
#: packages can be imported, installed or not. Those of others have an entry point in the group
#: `soilml.commands`.
COMMANDS = {
    "init": "soilml.cli.commands.init",
    "example": "soilml.cli.commands.example",
    "models": "soilml.cli.commands.models",
    "doctor": "soilml.cli.commands.doctor",
    "completion": "soilml.cli.commands.completion",
    "serve": "soilml.serve.command",
    "import": "soilml.cli.commands.import_",
    "soils": "soilml.cli.commands.soils",
    "effects": "soilml.cli.commands.effects",
    "simulate": "soilml.cli.commands.simulate",
    "identify": "soilml.cli.commands.identify",
    "bevameter": "soilml.cli.commands.bevameter",
    "export-soil": "soilml.cli.commands.export_soil",
    "audit": "soilml.cli.commands.audit",
    "gap": "soilml.cli.commands.gap",
    "adapt": "training.commands.adapt",
    "generate": "datagen.commands.generate",
    "train": "training.commands.train",
    "export-c": "training.commands.export_c",
    "export-fusion": "training.commands.export_fusion",
    "export-step": "training.commands.export_step",
    "export-slip": "training.commands.export_slip",
    "estimate": "soilml.cli.commands.estimate",
    "advise": "soilml.cli.commands.advise",
    "design-runs": "soilml.cli.commands.design_runs",
    "pull": "soilml.cli.commands.pull",
    "design": "soilml.cli.commands.design",
    "slip": "soilml.cli.commands.slip",
    "map": "soilml.cli.commands.map_",
    "compare": "training.commands.compare",
    "climb": "soilml.cli.commands.climb",
    "sensor-wheel": "soilml.cli.commands.sensor_wheel",
    "wheel-leg": "soilml.cli.commands.wheel_leg",
    "walk": "soilml.cli.commands.walk",
    "track": "soilml.cli.commands.track",
    "papers": "soilml.cli.commands.papers",
}
#: Commands of two words: the group, and by its second word the command. The command's own name is
#: an older one, which still works.
GROUPS = {
    "export": {
        "c": "export-c",
        "fusion": "export-fusion",
        "step": "export-step",
        "slip": "export-slip",
        "soil": "export-soil",
    },
    "plan": {"next": "advise", "effects": "audit", "runs": "design-runs"},
    "paper": {
        "climb": "climb",
        "sensor-wheel": "sensor-wheel",
        "wheel-leg": "wheel-leg",
        "walk": "walk",
        "track": "track",
        "numbers": "papers",
    },
}
#: What the list of commands says of a group.
GROUP_HELP = {
    "export": "a model file as C or a graph, the slip filter, a soil for simulators",
    "plan": "the next row, effects that runs could name, runs of a simulator",
    "paper": "systems of the source papers, and their printed numbers",
}
_TWO_WORDS = {name: (group, word) for group, own in GROUPS.items() for word, name in own.items()}
#: Options whose value may begin with a minus sign.
_NEGATIVE_VALUES = ("--slip", "--load", "--slips")
_WRONG_COMMAND = re.compile(r"argument COMMAND: invalid choice: '(.*)' \(choose from (.*)\)")
_UNKNOWN_OPTION = re.compile(r"unrecognized arguments: (?:[^-].*? )?(--?[\w-]+)")
_NEGATIVE = re.compile(r"-[\d.]")


class _Parser(argparse.ArgumentParser):
    """Reports an error in one line, which names the help.

    `known` are the options of the command that was asked for.
    """

    known: Sequence[str] = ()

    def error(self, message: str) -> NoReturn:
        wrong = _WRONG_COMMAND.fullmatch(message)
        if wrong is not None:
            names = re.findall(r"[\w-]+", wrong[2])
            near = did_you_mean(wrong[1], names)
            message = f"no command {wrong[1]!r}; {near}there are: {', '.join(names)}"
        if unknown := _UNKNOWN_OPTION.search(message):
            near = did_you_mean(unknown[1], self.known).removesuffix(" ")
            message += f"; {near}" if near else ""
        self.exit(fail(f"{message} (see {self.prog} --help)", 2, self.prog))

    def _print_message(self, message: str, file: Any = None) -> None:
        """Print help and version; argparse itself passes over a stream that cannot be written."""
        if message and (stream := file or sys.stderr) is not None:
            stream.write(message)
            stream.flush()


def parser(command: str | None = None) -> argparse.ArgumentParser:
    """The parser of the command line.

    command: The first word of a command line. If it is a command, its module alone is imported and
        its arguments are declared; if it is an option such as --help, or None, those of all
        commands.
    """
    layout: Any = argparse.RawDescriptionHelpFormatter
    root = _Parser("soilml", description=DESCRIPTION, epilog=EPILOG, formatter_class=layout)
    root.add_argument("--version", action="version", version=f"soilml {__version__}")
    commands = root.add_subparsers(metavar="COMMAND", required=True)
    own = command in (*COMMANDS, "--version")
    every = command is None or (command.startswith("-") and not own)
    for name, path in (COMMANDS if own else COMMANDS | _other_commands()).items():
        if not every and command != name:
            commands.add_parser(name)
            continue
        module = importlib.import_module(path)
        shown: dict[str, Any] = {"help": module.HELP}
        if name in _TWO_WORDS:  # the list has its group
            shown = {"prog": f"soilml {' '.join(_TWO_WORDS[name])}"}
        sub = commands.add_parser(
            name, description=module.DESCRIPTION, formatter_class=layout, **shown
        )
        module.add_arguments(sub)
        add_screen_options(sub, getattr(module, "FORMATS", ()))
        if command == name:
            root.known = [option for option in sub._option_string_actions if len(option) > 2]
            root.prog = sub.prog
        sub.set_defaults(run=module.run, outputs=getattr(module, "outputs", declared_outputs))
    for group, text in GROUP_HELP.items() if every else ():
        commands.add_parser(group, help=f"{', '.join(GROUPS[group])}: {text}", add_help=False)
    return root


def _other_commands() -> dict[str, str]:
    """Modules of the commands of other distributions, by name."""
    from importlib.metadata import entry_points

    # an installation of this one that is older than its files may name a command that is gone
    others = {
        entry.name: entry.value
        for entry in entry_points(group="soilml.commands")
        if entry.dist is None or entry.dist.name != "soilml"
    }
    return {name: others[name] for name in sorted(others.keys() - COMMANDS.keys())}


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
    words = _join_negative_values(_one_name(typed))
    args = parser(words[0] if words else "").parse_args(words)
    args.command_line, args.make_parser = typed, parser
    SCREEN.choose(getattr(args, "format", None), args.quiet, args.verbose)
    check_outputs(args.outputs(args), input_files(args))
    check_memory_limit()
    need_for_options(args, words[0])
    status = int(args.run(args) or 0)
    if sys.stdout is not None:
        sys.stdout.flush()
    return status


def _one_name(words: list[str]) -> list[str]:
    """The words with the command's own name first, in place of a group and its second word.

    Raises `InputError` for a group without one of its words.
    """
    group = GROUPS.get(words[0])
    if group is not None:
        if len(words) > 1 and words[1] in group:
            return [group[words[1]], *words[2:]]
        near = did_you_mean(words[1], list(group)) if len(words) > 1 else ""
        raise InputError(f"soilml {words[0]}: {near}needed is one of: {', '.join(group)}")
    if words[0] in _TWO_WORDS and sys.stderr is not None and sys.stderr.isatty():
        print(f"this command is now `soilml {' '.join(_TWO_WORDS[words[0]])}`", file=sys.stderr)
    return words


def _interrupted(stop: KeyboardInterrupt | Terminated) -> int:
    """Say that a signal stopped the command, and what was complete; returns the exit status."""
    clear_interrupted()
    code = stop.code if isinstance(stop, Terminated) else 128 + signal.SIGINT
    written = f"complete before that: {', '.join(replaced)}" if replaced else ""
    said = getattr(stop, "said", f"interrupted; {written or 'no output was written'}")
    return fail(said, int(code or 0))


def _join_negative_values(words: list[str]) -> list[str]:
    """`--slip -0.3:0.6:10` as one word, because argparse would read two options."""
    joined: list[str] = []
    for word in words:
        if word.startswith("--") and word.endswith("=--"):  # argparse drops this value
            raise InputError(f"{word}: needed is a value after the equals sign")
        if joined and joined[-1] in _NEGATIVE_VALUES and _NEGATIVE.match(word):
            joined[-1] += f"={word}"
        else:
            joined.append(word)
    return joined
