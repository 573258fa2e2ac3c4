"""The source papers, the numbers that they print, and their comparison with the computed ones."""

from __future__ import annotations

import csv
import importlib
import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from importlib import resources

from soilml.errors import InputError

#: Titles by the name that `soilml paper numbers` takes, and the chapters of a paper that differ
#: from its name: pairs CHAPTER.csv and CHAPTER.py in this folder.
PAPERS = {
    "nagatani2009": "Nagatani, Ikeda, Sato and Yoshida 2009: a wheel with force sensors",
    "nagatani_climbing": "Nagatani et al.: online estimation of climbing ability",
    "wang2018": "Wang, Yan and Du 2018: a tracked robot's mobility",
    "comin2017": "Comin and Saaj 2017: slip and soil from multi-legged wheel-legs",
    "xue2016": "Xue et al. 2016: LS-SVM for the shearing parameters of lunar soil",
}
CHAPTERS = {"comin2017": ("comin2017_terradynamics", "comin2017_slip")}
#: What a number is, as its row claims: code, and its name in tables.
STATUSES = {
    "reproduced": "reproduced independently",
    "recovered": "recovered from its own input",
    "arithmetic": "arithmetic on printed values",
    "depends": "depends on an open choice",
    "tuned": "tuned to match",
    "missed": "missed, with reason",
    "not_computed": "not computed: inputs not printed",
    "given": "given: input or setting",
    "wrong": "wrong: not what its row claims",
}
#: Statuses of rows whose computed number must lie within the tolerance.
AGREEING = frozenset({"reproduced", "recovered", "arithmetic", "depends", "tuned"})
#: Units of orders and counts, which papers state in words or draw; all others are quantities.
ORDINAL = frozenset({"rank", "legs"})


@dataclass(frozen=True)
class PrintedNumber:
    """A number printed in a paper, with the tolerance within which a model must reproduce it.

    `tolerance` is a fraction of the number where the file states per cent, else in its unit.
    `claimed` is one of `STATUSES`; all but `reproduced` and `given` state a `reason`: what was put
    in, or why the number is missed or not computed. `counted_with` names the row, KEY or PAPER:KEY,
    that counts this number already; empty for a row that is counted.
    """

    paper: str
    key: str
    what: str
    source: str
    unit: str
    published: float
    tolerance: float
    relative: bool
    claimed: str
    counted_with: str
    reason: str
    compute: Callable[[], float] | None
    alternatives: tuple[Callable[[], float], ...] = ()

    @property
    def allowed(self) -> float:
        """Largest difference that counts as agreement, in the number's unit."""
        return self.tolerance * (abs(self.published) if self.relative else 1.0)

    def compare(self) -> Comparison:
        """Compute the number and compare; takes as long as its model.

        An order or a count is computed by the other open choices too, where it agrees.
        """
        value = math.nan if self.compute is None else float(self.compute())
        agrees = self._agrees(value)
        keeps = not agrees or all(self._agrees(float(other())) for other in self.alternatives)
        return Comparison(self, value, agrees, keeps)

    def _agrees(self, value: float) -> bool:
        return bool(abs(value - self.published) <= self.allowed)


@dataclass(frozen=True)
class Comparison:
    """A printed number, the computed one (NaN: nothing computes it), and if they agree.

    keeps: Whether it agrees by all `alternatives` of its row too, which `reproduced` asks for.
    """

    row: PrintedNumber
    computed: float
    agrees: bool
    keeps: bool = True

    @property
    def status(self) -> str:
        """The status that the row claims if the computed number bears it out, else `wrong`."""
        claimed = self.row.claimed
        if math.isnan(self.computed):
            return claimed if claimed in ("not_computed", "given") else "wrong"
        if claimed in ("reproduced", "depends") and self.agrees:
            return "reproduced" if self.keeps else "depends"
        if claimed in AGREEING or claimed == "given":
            return claimed if self.agrees else "wrong"
        return "missed" if claimed == "missed" and not self.agrees else "wrong"


def count_statuses(found: Iterable[Comparison]) -> dict[str, dict[str, int]]:
    """Numbers by paper and status, each printed number once; only statuses that occur."""
    counted = [c for c in found if not c.row.counted_with]
    papers = dict.fromkeys(c.row.paper for c in counted)
    counts = {paper: Counter(c.status for c in counted if c.row.paper == paper) for paper in papers}
    occurring = [code for code in STATUSES if any(code in each for each in counts.values())]
    return {paper: {code: each[code] for code in occurring} for paper, each in counts.items()}


def read_chapter(chapter: str) -> list[dict[str, str]]:
    """The rows of the CSV file of a chapter."""
    text = resources.files("soilml.papers").joinpath(f"{chapter}.csv").read_text("utf-8")
    return list(csv.DictReader(text.splitlines()))


def printed(chapter: str) -> dict[str, float]:
    """The printed numbers of a chapter by key."""
    return {row["key"]: float(row["published"]) for row in read_chapter(chapter)}


def printed_numbers(paper: str | None = None) -> Iterator[PrintedNumber]:
    """Iterate over the printed numbers of one paper, or of all.

    Raises `InputError` for an unknown paper.

    Examples
    --------
    >>> number = next(printed_numbers("nagatani2009"))
    >>> number.what, number.published, number.compare().status
    ('wheel radius', 0.055, 'given')
    """
    if paper is not None and paper not in PAPERS:
        raise InputError(f"no paper {paper!r}; there are: {', '.join(PAPERS)}")
    for name in PAPERS if paper is None else (paper,):
        for chapter in CHAPTERS.get(name, (name,)):
            module = importlib.import_module(f"soilml.papers.{chapter}")
            for entry in read_chapter(chapter):
                tolerance = entry["tolerance"].strip()
                relative = tolerance.endswith("%")
                yield PrintedNumber(
                    paper=name,
                    key=entry["key"],
                    what=entry["what"],
                    source=entry["source"],
                    unit=entry["unit"],
                    published=float(entry["published"]),
                    tolerance=float(tolerance.rstrip("% ")) / (100.0 if relative else 1.0),
                    relative=relative,
                    claimed=entry["status"],
                    counted_with=entry["counted_with"],
                    reason=entry["reason"].strip(),
                    compute=module.COMPUTED.get(entry["key"]),
                    alternatives=getattr(module, "ALTERNATIVES", {}).get(entry["key"], ()),
                )
