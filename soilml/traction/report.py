"""Pull and slope from a case and a table of rows, with everything that must be said beside them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.case import Case
from soilml.identification.driven import operating
from soilml.identification.free import chosen
from soilml.identification.measured import measured_rows, same_wheel
from soilml.onboard import Estimator
from soilml.operating import COVARIATES
from soilml.quantities import column
from soilml.table import Table
from soilml.traction.draws import posterior_draws, prior_draws
from soilml.traction.onboard_soil import onboard_draws
from soilml.traction.prediction import LEFT_BEHIND
from soilml.traction.prospect import Prospect, asked_slips, driven_loads, prospects
from soilml.traction.words import NEVER, Driven

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Report:
    """Prospects under each load; slip, load (N) and pull (N) of rows that measured it, (k,)."""

    rows: int
    driven: Driven
    prospects: list[Prospect]
    measured: tuple[Floats, Floats, Floats]
    warnings: tuple[str, ...]


def pull_report(
    case: Case,
    table: Table,
    *,
    free: Sequence[str] | None = None,
    loads: Sequence[float] | None = None,
    slip_limit: float | None = None,
    estimator: Estimator | None = None,
) -> Report:
    """Pull and slope of a gear on the soil that the rows were driven on.

    The soil is known by the posterior of the rows, or as far as `estimator` knows it. Speed, pass
    and slip angle are those of the rows, their median. Raises as `identify` does, and `InputError`
    for a load that the soil does not carry.
    """
    warnings: list[str] = []
    if estimator is None:
        wanted = chosen(case, free)
        data = measured_rows(case, table)
        found = posterior_draws(case, data, wanted)
        draws = found.draws
        warnings += data.notes
        if [c.name for c in data.channels] == ["torque"]:
            warnings.append(
                "torque alone hardly shows what a model lacks: measure drawbar pull or sinkage too"
            )
        if found.surplus:
            warnings.append(
                f"residuals are {np.sqrt(found.misfit):.1f} times the declared noise: the model "
                "lacks something or the noise is understated; bands are wider, and may miss"
            )
    else:
        same_wheel(case, table)
        wanted, draws, said = onboard_draws(estimator, case, table.rows(table.answered))
        warnings += said
    left = [e.name for e in case.model.effects if e.about.kind in LEFT_BEHIND]
    if left:
        warnings.append(f"effects of rig and sensors stay behind: {', '.join(left)}")
    table = table.rows(table.answered)
    at = operating(table)
    driven = Driven.of(table["slip"], table["load_N"])
    given = {
        field: float(np.median(values))
        for field in COVARIATES
        if (values := getattr(at, field)) is not None
    }
    ahead = prospects(
        case,
        draws,
        prior_draws(wanted),
        driven_loads(table["load_N"]) if loads is None else loads,
        asked_slips(slip_limit, driven),
        driven,
        given,
    )
    key = column("drawbar_pull")
    pull = table[key] if key in table else np.full(len(table), np.nan)
    dots = np.isfinite(pull)
    measured = table["slip"][dots], table["load_N"][dots], pull[dots]
    return Report(len(table), driven, ahead, measured, (*warnings, NEVER))
