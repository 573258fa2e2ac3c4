"""Pull and slope from a case and a table of rows, with everything that must be said beside them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.identification.compatibility import check_wheel_size
from soilml.identification.free_parameters import select_free
from soilml.identification.observations import read_observations
from soilml.identification.operating_points import operating_points
from soilml.io.table import Table
from soilml.onboard.estimator import Estimator
from soilml.physics.operating_point import COVARIATES
from soilml.quantities import column
from soilml.traction.by_load import LoadPrediction, asked_slips, driven_loads, predictions_by_load
from soilml.traction.messages import NEVER, DrivenRange
from soilml.traction.onboard_draws import onboard_draws
from soilml.traction.pull_and_slope import LEFT_BEHIND
from soilml.traction.soil_draws import posterior_draws, prior_draws

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class PullReport:
    """Prospects under each load; slip, load (N) and pull (N) of rows that measured it, (k,)."""

    rows: int
    driven: DrivenRange
    by_load: list[LoadPrediction]
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
) -> PullReport:
    """Pull and slope of a gear on the soil that the rows were driven on.

    The soil is known by the posterior of the rows, or as far as `estimator` knows it. Speed, pass
    and slip angle are those of the rows, their median. Raises as `identify` does, and `InputError`
    for a load that the soil does not carry.
    """
    warnings: list[str] = []
    if estimator is None:
        wanted = select_free(case, free)
        data = read_observations(case, table)
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
        check_wheel_size(case, table)
        wanted, draws, said = onboard_draws(estimator, case, table.rows(table.answered))
        warnings += said
    left = [e.name for e in case.model.effects if e.about.kind in LEFT_BEHIND]
    if left:
        warnings.append(f"effects of rig and sensors stay behind: {', '.join(left)}")
    table = table.rows(table.answered)
    at = operating_points(table)
    driven = DrivenRange.of(table["slip"], table["load_N"])
    given = {
        field: float(np.median(values))
        for field in COVARIATES
        if (values := getattr(at, field)) is not None
    }
    ahead = predictions_by_load(
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
    return PullReport(len(table), driven, ahead, measured, (*warnings, NEVER))
