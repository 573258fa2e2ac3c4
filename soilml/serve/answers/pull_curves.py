"""Drawbar pull and slope against slip, with their bands."""

from __future__ import annotations

from typing import Any

import numpy as np

from soilml.config.case import Case
from soilml.errors import InputError
from soilml.io.table import Table
from soilml.numerics.quantile_band import QuantileBand, quantile_band
from soilml.quantities import NOT_IDENTIFIED_ABOVE
from soilml.remarks import texts
from soilml.traction.by_load import LoadPrediction
from soilml.traction.report import PullReport, pull_report


def pull_curves(report: PullReport) -> dict[str, Any]:
    """The curves of each load, with pull in N and slope in degrees."""
    slip, load, pull = report.measured_pull
    return {
        "loads": [_curves(one) for one in report.by_load],
        "measured": {"slip": slip.tolist(), "load": load.tolist(), "pull": pull.tolist()},
        "warnings": texts(report.warnings),
    }


def pull_of_gears(case: Case, table: Table, as_usual: bool) -> dict[str, Any]:
    """The curves of each gear that was driven, on the soil that its own rows show.

    Raises `InputError` where rows do not name their gear.
    """
    if "gear" not in table:
        raise InputError("MODEL.toml has several gears, and the table no column gear")
    loads, warnings = [], ["the soil below each wheel is that of its own rows"]
    for name in case.gears:
        rows = table.rows(table["gear"] == name)
        if len(rows):
            own = pull_curves(pull_report(case.of_gear(name), rows, as_usual=as_usual))
            loads += [one | {"gear": name, "measured": own["measured"]} for one in own["loads"]]
            warnings += own["warnings"]
    if not loads:
        raise InputError(f"no row has a gear of MODEL.toml: {', '.join(case.gears)}")
    return {"loads": loads, "warnings": list(dict.fromkeys(warnings))}


def _curves(one: LoadPrediction) -> dict[str, Any]:
    after, before = one.posterior, one.prior
    return {
        "load": after.load,
        "slip": after.slip.tolist(),
        "pull": _band(quantile_band(after.pull)),
        "prior_pull": _band(quantile_band(before.pull)),
        "slope": _band(quantile_band(np.rad2deg(after.slope))),
        "prior_slope": _band(quantile_band(np.rad2deg(before.slope))),
        "largest_pull": _band(quantile_band(after.largest_pull)),
        "best_slip": _band(quantile_band(after.best_slip)),
        "steepest_slope": _band(quantile_band(np.rad2deg(after.steepest_slope))),
        "known": [left <= NOT_IDENTIFIED_ABOVE for left in one.remaining_fraction],
        "warnings": texts(one.warnings),
    }


def _band(found: QuantileBand) -> list[Any]:
    """Lower end, median, upper end."""
    return [np.asarray(v).tolist() for v in (found.lower, found.middle, found.upper)]
