"""Remarks on results: programs tell them apart by code, people by text."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, Literal

Severity = Literal["note", "warning"]


@dataclass(frozen=True)
class Remark:
    """One thing that a reader of a result should know.

    Decisions are made from `code` and `about`; no program reads the text.
    """

    code: str  # What is the matter, in words that do not change: `not-identified`
    text: str  # The same as a sentence for a person
    # Names of the parameters, channels, runs or effects that it concerns
    about: tuple[str, ...] = ()
    # `warning` where a figure must not be taken at face value, `note` otherwise
    severity: Severity = "warning"

    def __str__(self) -> str:
        return self.text

    def under(self, head: str) -> Remark:
        """The same with a head before its text, such as `run a: `."""
        return replace(self, text=f"{head}{self.text}")

    def as_json(self) -> dict[str, Any]:
        """The remark in a file of results."""
        about = list(self.about)
        return {"code": self.code, "about": about, "severity": self.severity, "text": self.text}


def about(remarks: Iterable[Remark], code: str) -> set[str]:
    """Names that the remarks with this code concern."""
    return {name for remark in remarks if remark.code == code for name in remark.about}


def texts(remarks: Iterable[Remark]) -> list[str]:
    """The sentences of remarks."""
    return [remark.text for remark in remarks]
