"""A fit with the errors that models and sensors typically have, beside the one without them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from soilml.config.case import Case
from soilml.errors import FitError
from soilml.identification import CLOSED_FORM, identify
from soilml.identification.fit import Fit
from soilml.io.table import Table
from soilml.remarks import Remark


@dataclass(frozen=True)
class TypicalErrorFit:
    """The fit with typical errors, and the one that takes the model as exact."""

    exact: Fit
    typical: Fit

    def as_json(self) -> dict[str, Any]:
        """The content of `as_usual` in the file."""
        content = self.typical.as_json()
        note = self.remark().as_json()
        return {key: content[key] for key in ("parameters", "misfit")} | {"note": note}

    def remark(self) -> Remark:
        """Which of the two intervals to use."""
        if _explains(self.exact):
            return Remark(
                "use-typical-errors",
                "use the interval that includes typical errors, unless this model was verified on "
                "a known soil: the other takes wheel, soil and sensors to be exactly as in the "
                "model file",
            )
        if _explains(self.typical):
            return Remark(
                "use-typical-errors",
                "the model taken as exact does not explain the rows, with typical errors it does: "
                "use the interval that includes them",
            )
        return Remark(
            "no-interval-explains",
            "the rows are explained neither by the model taken as exact nor with typical errors: "
            "use neither interval, and run soilml gap",
        )


def _explains(fit: Fit) -> bool:
    return all(remark.code != "excess-residuals" for remark in fit.warnings)


def fit_with_typical_errors(
    case: Case, rows: Table, free: Sequence[str] | None, method: str, exact: Fit
) -> TypicalErrorFit | None:
    """The fit with typical errors beside `exact`, or None.

    None for a method that takes the model as exact, where the case states the error of its model,
    and where no fit is possible with typical errors.
    """
    if method in CLOSED_FORM or case.discrepancy:
        return None
    try:
        typical = identify(case, rows, free, method, as_usual=True)
        return TypicalErrorFit(exact, replace(typical, samples=None))
    except FitError:
        return None
