"""The source papers, the numbers that they print, and their comparison with the computed ones."""

from __future__ import annotations

import csv
import importlib
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import resources

from soilml.errors import InputError


@dataclass(frozen=True)
class Paper:
    """Title of a paper, and its chapters where they differ from the paper's own name.

    Each chapter is a pair CHAPTER.csv and CHAPTER.py in this folder.
    """

    title: str
    chapters: tuple[str, ...] = ()


#: By the name that `soilml papers` takes.
PAPERS: dict[str, Paper] = {
    "nagatani2009": Paper("Nagatani, Ikeda, Sato and Yoshida 2009: a wheel with force sensors"),
    "nagatani_climbing": Paper("Nagatani et al.: online estimation of climbing ability"),
    "wang2018": Paper("Wang, Yan and Du 2018: a tracked robot's mobility"),
    "comin2017": Paper(
        "Comin and Saaj 2017: slip and soil from multi-legged wheel-legs",
        ("comin2017_terradynamics", "comin2017_slip"),
    ),
    "xue2016": Paper("Xue et al. 2016: LS-SVM for the shearing parameters of lunar soil"),
}


def chapters(name: str) -> tuple[str, ...]:
    """The chapters of a paper: its own name if it does not list any."""
    return PAPERS[name].chapters or (name,)


#: Columns of the CSV file of a chapter.
COLUMNS = ("key", "what", "source", "unit", "published", "tolerance", "reason")


@dataclass(frozen=True)
class PrintedNumber:
    """A number printed in a paper, with the tolerance within which a model must reproduce it.

    `tolerance` is a fraction of the number where the file states per cent, else in its unit. A row
    with a `reason` is known not to be reproduced; a row that nothing computes must have a reason.
    An input (`is_input`) is kept by the model as printed: it is read back and is not a result.
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
    is_input: bool
    compute: Callable[[], float] | None

    @property
    def allowed(self) -> float:
        """Largest difference that counts as reproduced, in the number's unit."""
        return self.tolerance * (abs(self.published) if self.relative else 1.0)

    def compare(self) -> Comparison:
        """Compute the number and compare; takes as long as its model."""
        value = math.nan if self.compute is None else float(self.compute())
        return Comparison(self, value, bool(abs(value - self.published) <= self.allowed))


@dataclass(frozen=True)
class Comparison:
    """A printed number, the computed one (NaN where nothing computes it), and the result."""

    row: PrintedNumber
    computed: float
    reproduced: bool

    @property
    def verdict(self) -> str:
        """yes, known, NO, given or not computed: see `soilml papers --help`."""
        if self.reproduced:
            return "given" if self.row.is_input else "yes"
        if not self.row.reason:
            return "NO"
        return "not computed" if math.isnan(self.computed) else "known"


def printed_numbers(paper: str | None = None) -> Iterator[PrintedNumber]:
    """Iterate over the printed numbers of one paper, or of all.

    Raises `InputError` for an unknown paper.

    Examples
    --------
    >>> number = next(printed_numbers("nagatani2009"))
    >>> number.what, number.published, number.compare().verdict
    ('wheel radius', 0.055, 'given')
    """
    if paper is not None and paper not in PAPERS:
        raise InputError(f"no paper {paper!r}; there are: {', '.join(PAPERS)}")
    for name in PAPERS if paper is None else (paper,):
        for chapter in chapters(name):
            module = importlib.import_module(f"soilml.papers.{chapter}")
            inputs: frozenset[str] = getattr(module, "INPUTS", frozenset())
            text = resources.files("soilml.papers").joinpath(f"{chapter}.csv").read_text("utf-8")
            for entry in csv.DictReader(text.splitlines()):
                compute = module.COMPUTED.get(entry["key"])
                yield _parse_row(name, entry, compute, entry["key"] in inputs)


def _parse_row(
    paper: str, entry: dict[str, str], compute: Callable[[], float] | None, is_input: bool
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
        is_input=is_input,
        compute=compute,
    )
