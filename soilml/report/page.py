"""The files of a result: a self-contained HTML page, and JSON beside it with its provenance."""

from __future__ import annotations

import hashlib
import json
import math
import os
import re
import shlex
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from soilml.optional_imports import need
from soilml.report.figure_style import svg_images
from soilml.report.numbers import capitalised, pretty
from soilml.report.report import MOST_ROWS, Report

#: Version of the entry `report` in the JSON files: raised where a key changes its meaning or goes.
FORMAT_VERSION = 3
_BLOCK = 1 << 20
#: What is written to a file: its text, or a function of the path.
Content = str | Callable[[Path], object]


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

    def as_json(self) -> dict[str, Any]:
        """The entries of a JSON file."""
        files = [{"name": f.name, "bytes": f.size, "sha256": f.sha256} for f in self.files]
        return {"command": self.command, "soilml_version": self.version, "files": files}


def page_content(report: Report) -> dict[str, Any]:
    """What a page shows of a report: texts, cells of tables, and pictures as elements `svg`."""
    tables = []
    for table in report.all_tables:
        heads, rows, words = table.cells()
        tables.append(
            {
                "title": _said(table.title),
                "note": _said(table.note),
                "heads": [pretty(cell) for cell in heads],
                "rows": [[pretty(cell) for cell in row] for row in rows[:MOST_ROWS]],
                "words": words,
                "count": len(rows),
            }
        )
    return {
        "title": report.title,
        "verdict": pretty(report.verdict),
        "lines": [pretty(line) for line in report.lines],
        "next": [_said(step) for step in report.next_steps],
        "status": report.status,
        "tone": report.tone,
        "basis": pretty(report.basis),
        "pictures": [
            {
                "title": _said(picture.title),
                "caption": pretty(picture.caption),
                "images": svg_images(picture, f"p{i}"),
            }
            for i, picture in enumerate(report.pictures)
        ],
        "with_figures": report.figures is not None,
        "tables": tables,
        "remarks": [_said(remark.text) for remark in report.remarks],
        "details": [
            [_said(head), [t if "\n" in t else _said(t) for t in texts]]
            for head, texts in report.details
        ],
        "notation": [[pretty(term), pretty(text)] for term, text in report.notation],
    }


def _said(text: str) -> str:
    """A text as a sentence of a page."""
    return pretty(capitalised(text)) if text else ""


def page(report: Report, origin: Provenance) -> str:
    """The report as HTML."""
    for library in ("jinja2", "matplotlib"):
        need(library, report.kind)
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("soilml", "report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    template = environment.get_template("report.html.j2")
    return template.render(page=page_content(report), origin=origin)


def report_entry(report: Report, origin: Provenance) -> dict[str, Any]:
    """The entry `report` of the JSON file beside the page."""
    return {
        "format": "soilml-report",
        "version": FORMAT_VERSION,
        "kind": report.kind,
        **origin.as_json(),
        "answer": report.answer,
        "warnings": [remark.as_json() for remark in report.remarks],
        "next": list(report.next_steps),
    }


def report_texts(
    report: Report,
    origin: Provenance,
    content: Mapping[str, Any],
    names: tuple[str, str],
    folder: Path,
) -> dict[Path, Content]:
    """The page and the JSON file, by their paths; `content` is the result in SI units."""
    html, json_name = names
    entry = {"report": report_entry(report, origin)}
    return {
        folder / html: page(report, origin),
        folder / json_name: json_text({**content, **entry}),
    }


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
