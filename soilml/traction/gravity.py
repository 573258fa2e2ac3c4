"""Draws of a soil under another gravity, and how far the answer depends on the law of gravity."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.errors import InputError
from soilml.numerics.quantiles import quantile_band
from soilml.physics.soils.gravity_law import CHANGED, SCHOOLS, GravityChange
from soilml.remarks import Remark
from soilml.report.tables import Column, ReportTable
from soilml.traction.draws import SoilDraws


def draws_at_gravity(case: Case, draws: SoilDraws, change: GravityChange) -> SoilDraws:
    """The draws (n, p) with the parameters that they have under another gravity, (n, q).

    Each draw of the soil has a draw of the law, whatever the soil: tests under one gravity do not
    tell the law. Parameters that change and were not drawn are added. Errors of the model stay.

    Raises `InputError` for a case whose model is another program, whose runs had one gravity, and
    as `GravityChange.parameters` does.
    """
    if change.ratio == 1.0:
        return draws
    if case.simulator is not None:
        raise InputError(
            "the runs of [simulator] had one gravity: let the program run under the other one, or "
            "take a model file with [gear]"
        )
    values = {name: draws.values[:, i] for i, name in enumerate(draws.names)}
    values |= {k: np.asarray(case.numbers[k]) for k in CHANGED if k not in values}
    count = len(draws.values)
    new = change.parameters(values, change.draws(count))
    columns = [np.broadcast_to(column, count) for column in new.values()]
    return replace(draws, names=tuple(new), values=np.stack(columns, axis=1))


#: Answers of one law: draws (n,) by column name, in the unit that is printed.
Answers = Mapping[str, Floats]


@dataclass(frozen=True)
class LawComparison:
    """The same answers by the open law, which is first, and by each school, as if it were known."""

    by_law: Mapping[str, Answers]

    def table(self) -> ReportTable:
        """A row for each law: median and 90 % band of each answer."""
        columns = [Column("law of gravity", list(self.by_law))]
        for name in next(iter(self.by_law.values())):
            bands = [quantile_band(answers[name]) for answers in self.by_law.values()]
            columns.append(Column.of_bands(name.replace("_", " "), bands))
        return ReportTable("By law of gravity", columns)

    def remark(self) -> Remark:
        """How much of the width of the first answer's band is due to the doubt of the law."""
        name = next(iter(next(iter(self.by_law.values()))))
        wide, *known = (float(quantile_band(a[name]).width) for a in self.by_law.values())
        share = max(1.0 - float(np.mean(known)) / wide, 0.0) if wide > 0.0 else 0.0
        ends = ", ".join(f"{w:.1f} if {law}" for law, w in zip(SCHOOLS, known, strict=True))
        text = (
            f"the law of gravity makes {share:.0%} of the band of {name}: it is {wide:.1f} wide, "
            f"with the law known {ends}"
        )
        return Remark("gravity-law-width", text, (name,), "note")


def compare_laws(
    case: Case, draws: SoilDraws, change: GravityChange, answers: Callable[[SoilDraws], Answers]
) -> LawComparison | None:
    """The answers by each law; None where the law is not in doubt.

    draws: Under the gravity of the tests.
    answers: What is computed from draws under the other one.
    """
    if not change.is_open:
        return None
    changes = [change, *(replace(change, law=law) for law in SCHOOLS)]
    return LawComparison({c.law: answers(draws_at_gravity(case, draws, c)) for c in changes})


def gravity_remark(change: GravityChange) -> Remark:
    """What was assumed of the soil under the other gravity."""
    text = {
        "open": "is drawn between one whose moduli stay and one whose kphi is in proportion to "
        "gravity: rows under one gravity do not tell which",
        "constant": "is taken to keep its moduli",
        "proportional": "is taken to have its kphi in proportion to gravity",
    }[change.law]
    if change.ratio < 1.0:
        text += "; in flights a wheel sank deeper and pulled less than under its load on Earth"
    return Remark(
        "gravity-law",
        f"gravity is {change.target:.3g} m/s^2, rows are from {change.tested:.3g} m/s^2: the soil "
        f"{text}",
        severity="warning" if change.law == "constant" else "note",
    )
