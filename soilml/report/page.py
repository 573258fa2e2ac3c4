"""The files of a result: one page for all reports, self-contained HTML, and JSON beside it."""

from __future__ import annotations

import hashlib
import json
import math
import os
import re
import shlex
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from soilml.optional_imports import need
from soilml.remarks import Remark
from soilml.report import numbers
from soilml.report.figure_style import SvgImage

if TYPE_CHECKING:
    from jinja2 import Environment

#: Version of the entry `report` in the JSON files: raised where a key changes its meaning or goes.
FORMAT_VERSION = 3
_BLOCK = 1 << 20
MOST_ROWS = 200  # Most rows of a table on a page; the JSON file has all


@dataclass(frozen=True)
class InputRecord:
    """A file that was read: its name as given, its size in bytes and its SHA-256 checksum.

    Size and checksum are None for what is no regular file, such as a pipe or a folder.
    """

    name: str
    size: int | None = None
    sha256: str | None = None

    @staticmethod
    def of(path: str | os.PathLike[str]) -> InputRecord:
        """The record of a file as it is now."""
        file = Path(path)
        try:
            if not file.is_file():
                return InputRecord(os.fspath(path))
            total, found = 0, hashlib.sha256()
            with file.open("rb") as opened:
                while block := opened.read(_BLOCK):
                    total += len(block)
                    found.update(block)
        except OSError:
            return InputRecord(os.fspath(path))
        return InputRecord(os.fspath(path), total, found.hexdigest())


@dataclass(frozen=True)
class Provenance:
    """Command line, version of soilml, and input files."""

    command: str
    version: str
    files: tuple[InputRecord, ...] = ()

    @staticmethod
    def of(words: Sequence[str], files: Iterable[str | os.PathLike[str]]) -> Provenance:
        """The origin of a report that the words after `soilml` asked for."""
        from soilml import __version__

        names = [name for name in dict.fromkeys(os.fspath(f) for f in files) if Path(name).exists()]
        records = tuple(InputRecord.of(name) for name in names)
        return Provenance(shlex.join(["soilml", *words]), __version__, records)


def _plain(text: str) -> str:
    return text.replace("\N{NO-BREAK SPACE}", " ")


@dataclass(frozen=True)
class ReportTable:
    """A table: caption, header, rows of cells, and how many columns from the left are text."""

    caption: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    text_columns: int = 1

    @property
    def shown(self) -> Sequence[Sequence[str]]:
        """The rows that the page shows."""
        return self.rows[:MOST_ROWS]


@dataclass(frozen=True)
class ReportPicture:
    """A picture with its title, and what it shows."""

    title: str
    image: SvgImage
    caption: str = ""


@dataclass(frozen=True)
class Report:
    """What a page says.

    kind: The command that made it.
    title: What was asked, in words.
    badge, meaning: The verdict in a word or two, and the rest of that sentence.
    answer: Sentences with units and intervals, the main one first.
    tone: Colour of the verdict: `named` (blue), `no-gap` (green), `suspected` (yellow) or
        `bad-data` (red), or another status of the gap analysis.
    warnings: Flags, abstentions and limits.
    next_steps: What to do next.
    notation: Terms of the footer, with their meaning.
    """

    kind: str
    title: str
    badge: str
    meaning: str
    answer: Sequence[str]
    tone: str = "named"
    pictures: Sequence[ReportPicture] = ()
    tables: Sequence[ReportTable] = ()
    warnings: Sequence[Remark] = ()
    next_steps: Sequence[str] = ()
    notation: Sequence[tuple[str, str]] = field(default_factory=tuple)

    def as_json(self, origin: Provenance) -> dict[str, Any]:
        """The entry `report` of the JSON file beside the page."""
        return {
            "format": "soilml-report",
            "version": FORMAT_VERSION,
            "kind": self.kind,
            "command": origin.command,
            "soilml_version": origin.version,
            "files": [{"name": f.name, "bytes": f.size, "sha256": f.sha256} for f in origin.files],
            "answer": [_plain(text) for text in self.answer],
            "warnings": [replace(w, text=_plain(w.text)).as_json() for w in self.warnings],
            "next": [_plain(text) for text in self.next_steps],
        }


def page(report: Report, origin: Provenance) -> str:
    """The report as HTML."""
    return render("report.html.j2", "soilml.report", report.kind, page=report, origin=origin)


def render(template: str, package: str, command: str, **content: Any) -> str:
    """A template that extends `report.html.j2`, from the folder of its package, as HTML.

    command: The command that is named where jinja2 is missing.
    content: Variables of the template; `page` is a `Report`, `origin` a `Provenance`.
    """
    need("jinja2", command)
    return _environment(package).get_template(template).render(**content)


def _environment(package: str) -> Environment:
    from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined

    name, _, folder = package.rpartition(".")
    environment = Environment(
        loader=ChoiceLoader([PackageLoader(name, folder), PackageLoader("soilml", "report")]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "figure": numbers.format_number,
        "chance": numbers.format_p_value,
        "channel": numbers.channel_name,
        "gain": numbers.format_gain,
        "probability": numbers.format_probability,
        "quantity": numbers.format_quantity,
        "sentence": lambda text: numbers.capitalised(str(text)),
    }
    return environment


#: What is written to a file: its text, or a function of the path.
Content = str | Callable[[Path], object]


#: A list of numbers over several lines, up to its end; texts have no line ends of their own.
_NUMBER = r"(?:-?\d[\d.eE+-]*|null)"
_NUMBERS = re.compile(rf"\[\n\s*{_NUMBER}(?:,\n\s*{_NUMBER})*\n\s*(?=\])")


def json_text(content: Any) -> str:
    """The content as indented JSON; numbers that are not finite become null, as JSON has none.

    A list of numbers is one line.
    """
    text = json.dumps(finite_or_null(content), indent=2, allow_nan=False)
    return _NUMBERS.sub(lambda found: " ".join(found[0].split()).replace("[ ", "["), text) + "\n"


def finite_or_null(value: Any) -> Any:
    """The content with None for every number that is not finite."""
    if isinstance(value, dict):
        return {key: finite_or_null(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [finite_or_null(entry) for entry in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def report_texts(
    report: Report,
    origin: Provenance,
    content: Mapping[str, Any],
    names: tuple[str, str],
    folder: Path,
) -> dict[Path, Content]:
    """The page and the JSON file, by their paths; `content` is the result in SI units."""
    from soilml.report.page import page

    html, json_name = names
    entry = {"report": report.as_json(origin)}
    return {
        folder / html: page(report, origin),
        folder / json_name: json_text({**content, **entry}),
    }
