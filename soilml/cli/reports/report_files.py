"""The files of a report: a page and a JSON file with the same numbers, as parts of one set."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from soilml.cli.options import input_files
from soilml.cli.output import json_text
from soilml.cli.output_names import REPORT_FILES
from soilml.io.atomic_files import write_files
from soilml.report.page import Provenance, Report, page

#: What is written to a file: its text, or a function of the path.
Content = str | Callable[[Path], object]


def origin_of(args: argparse.Namespace, files: Iterable[str] = ()) -> Provenance:
    """The command and its input files, of which `files` are some that no argument names."""
    return Provenance.of(getattr(args, "command_line", []), [*input_files(args), *files])


def report_texts(
    report: Report,
    origin: Provenance,
    content: Mapping[str, Any],
    names: tuple[str, str],
    folder: Path,
) -> dict[Path, Content]:
    """The page and the JSON file, by their paths; `content` is the result in SI units."""
    html, json_name = names
    entry = {"report": report.as_json(origin)}
    return {
        folder / html: page(report, origin),
        folder / json_name: json_text({**content, **entry}),
    }


def write_with_report(
    args: argparse.Namespace,
    contents: Mapping[str | None, Content],
    build: Callable[[], tuple[Report, Mapping[str, Any]]],
    read: Iterable[str] = (),
) -> None:
    """Write the outputs of a command, and those of --report, as one set.

    Parameters
    ----------
    contents
        What is written to each path; None as a path is an option that was not given.
    build
        Gives the report and the result in SI units; called where --report is given.
    read
        Input files that no argument names.
    """
    files = {Path(path): content for path, content in contents.items() if path is not None}
    if args.report is not None:
        report, content = build()
        names = (REPORT_FILES[0], REPORT_FILES[1])
        files |= report_texts(report, origin_of(args, read), content, names, Path(args.report))
    write_files(files, folders=[args.report])
