"""The one page of all reports: self-contained HTML without scripts, for screen and print."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from soilml.optional_imports import need
from soilml.report import numbers
from soilml.report.figure_style import SvgImage
from soilml.report.page import Origin, report_entry

if TYPE_CHECKING:
    from jinja2 import Environment

#: Most rows of a table on a page; the JSON file has all.
MOST_ROWS = 200


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

    Attributes
    ----------
    kind
        The command that made it.
    title
        What was asked, in words.
    badge, meaning
        The verdict in a word or two, and the rest of that sentence.
    answer
        Sentences with units and intervals, the main one first.
    tone
        Colour of the verdict: `named` (blue), `no-gap` (green), `suspected` (yellow) or `bad-data`
        (red), or another status of the gap analysis.
    warnings
        Flags, abstentions and limits.
    next_steps
        What to do next.
    notation
        Terms of the footer, with their meaning.
    """

    kind: str
    title: str
    badge: str
    meaning: str
    answer: Sequence[str]
    tone: str = "named"
    pictures: Sequence[ReportPicture] = ()
    tables: Sequence[ReportTable] = ()
    warnings: Sequence[str] = ()
    next_steps: Sequence[str] = ()
    notation: Sequence[tuple[str, str]] = field(default_factory=tuple)

    def as_json(self, origin: Origin) -> dict[str, Any]:
        """The entry `report` of the JSON file beside the page."""
        return report_entry(self.kind, origin, self.answer, self.warnings, self.next_steps)


def page(report: Report, origin: Origin) -> str:
    """The report as HTML."""
    return render("report.html.j2", "soilml.report", report.kind, page=report, origin=origin)


def render(template: str, package: str, command: str, **content: Any) -> str:
    """A template that extends `report.html.j2`, from the folder of its package, as HTML.

    Parameters
    ----------
    command
        The command that is named where jinja2 is missing.
    content
        Variables of the template; `page` is a `Report`, `origin` an `Origin`.
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
        "quantity": numbers.format_quantity,
        "sentence": numbers.capitalised,
    }
    return environment
