"""A printed number, and how a computed one stands beside it."""

from __future__ import annotations

import csv
import importlib
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import resources

from soilml.errors import InputError
from soilml.papers import PAPERS

COLUMNS = ("key", "what", "source", "unit", "published", "tolerance", "reason")


@dataclass(frozen=True)
class PrintedNumber:
    """A number that a paper prints, how near a faithful model must come, or why it cannot.

    `tolerance` is a share of the number where the file gives per cent, else in its unit. A row
    with a `reason` is known not to be reproduced; one that nothing computes must have a reason.
    A number that is `given` is an input that the model keeps as printed: read back, not computed.
    """

    paper: str
    key: str
    what: str
    source: str
    unit: str
    published: float
    tolerance: float
    relative: bool
    reason: str
    given: bool
    compute: Callable[[], float] | None

    @property
    def allowed(self) -> float:
        """Largest difference that counts as reproduced, in the number's unit."""
        return self.tolerance * (abs(self.published) if self.relative else 1.0)

    def compared(self) -> Comparison:
        """Compute the number and judge it; takes as long as its model takes."""
        value = math.nan if self.compute is None else float(self.compute())
        return Comparison(self, value, bool(abs(value - self.published) <= self.allowed))


@dataclass(frozen=True)
class Comparison:
    """A printed number, the computed one (NaN where nothing computes it), and the judgement."""

    row: PrintedNumber
    computed: float
    holds: bool

    @property
    def said(self) -> str:
        """The judgement in words."""
        if self.holds:
            return "given" if self.row.given else "yes"
        if not self.row.reason:
            return "NO"
        return "not computed" if math.isnan(self.computed) else "known"

    @property
    def honest(self) -> bool:
        """Whether the file tells the truth: reproduced, or not and said so."""
        return self.holds != bool(self.row.reason)


def printed_numbers(paper: str | None = None) -> Iterator[PrintedNumber]:
    """Every row of one paper, or of all; raises `InputError` for a paper that is not there."""
    if paper is not None and paper not in PAPERS:
        raise InputError(f"no paper {paper!r}; there are: {', '.join(PAPERS)}")
    for name in PAPERS if paper is None else (paper,):
        for chapter in PAPERS[name]:
            module = importlib.import_module(f"soilml.papers.{chapter}")
            given: frozenset[str] = getattr(module, "GIVEN", frozenset())
            text = resources.files("soilml.papers").joinpath(f"{chapter}.csv").read_text("utf-8")
            for entry in csv.DictReader(text.splitlines()):
                compute = module.COMPUTED.get(entry["key"])
                yield _row(name, entry, compute, entry["key"] in given)


def _row(
    paper: str, entry: dict[str, str], compute: Callable[[], float] | None, given: bool
) -> PrintedNumber:
    tolerance, relative = entry["tolerance"].strip(), entry["tolerance"].strip().endswith("%")
    return PrintedNumber(
        paper=paper,
        key=entry["key"],
        what=entry["what"],
        source=entry["source"],
        unit=entry["unit"],
        published=float(entry["published"]),
        tolerance=float(tolerance.rstrip("% ")) / 100.0 if relative else float(tolerance),
        relative=relative,
        reason=entry["reason"].strip(),
        given=given,
        compute=compute,
    )
