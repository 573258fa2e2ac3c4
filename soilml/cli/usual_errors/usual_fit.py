"""The second answer of `identify`: with the errors that sensors and models usually have."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from soilml.config.case import Case
from soilml.errors import FitError
from soilml.identification import CLOSED_FORM, identify
from soilml.identification.fit_result import Fit
from soilml.io.table import Table
from soilml.io.text_tables import format_table
from soilml.report.terminal import interval, rounded, shown_unit


@dataclass(frozen=True)
class UsualFit:
    """A fit with usual errors, beside the one that takes the model as right."""

    right: Fit
    usual: Fit

    def as_json(self) -> dict[str, Any]:
        """The content of `as_usual` in the file."""
        content = self.usual.as_json()
        return {key: content[key] for key in ("parameters", "misfit")} | {"note": self.note()}

    def text(self) -> str:
        """Both intervals in a table, and which one to believe."""
        right, usual = self.right, self.usual
        rows = [
            (*cells, f"{ratio:.1f}")
            for cells, ratio in zip(fit_cells(usual), usual.std / right.std, strict=True)
        ]
        head = ("parameter", "value", "std", "90 % interval", "unit", "times std above")
        return (
            "as usual, with the errors that sensors and models usually have\n\n"
            f"{format_table(head, rows)}\n! {self.note()}"
        )

    def note(self) -> str:
        """Which of the two answers to believe."""
        if not self._explained(self.right):
            if self._explained(self.usual):
                return (
                    "the model as it is does not explain the rows, with usual errors it does: "
                    "believe the second answer"
                )
            return (
                "the rows are explained neither by the model as it is nor with usual errors: "
                "believe neither answer, and run soilml gap"
            )
        return (
            "believe the second answer, unless this model was checked on a soil that is known: the "
            "first is as if wheel, soil and sensors were as the model file says"
        )

    @staticmethod
    def _explained(fit: Fit) -> bool:
        return all(remark.code != "excess-residuals" for remark in fit.warnings)


def fit_cells(fit: Fit) -> list[tuple[str, str, str, str, str]]:
    """Name, value, std, 90 % interval and unit of each parameter, as a terminal shows them."""
    rows = []
    for name, value, std, low, high, unit in zip(
        fit.names, fit.values, fit.std, *fit.interval, fit.units, strict=True
    ):
        factor, shown = shown_unit(unit, float(abs(value)))
        value, std, low, high = (factor * float(v) for v in (value, std, low, high))
        rows.append((name, rounded(value, std), rounded(std, std), interval(low, high, std), shown))
    return rows


def usual_fit(
    case: Case, rows: Table, free: Sequence[str] | None, method: str, right: Fit
) -> UsualFit | None:
    """The second answer, or None.

    None for a method that takes the model as right, where the case states the error of its model,
    and where no fit is possible with usual errors.
    """
    if method in CLOSED_FORM or case.discrepancy:
        return None
    try:
        usual = identify(case, rows, free, method, as_usual=True)
        return UsualFit(right, replace(usual, samples=None))
    except FitError:
        return None
