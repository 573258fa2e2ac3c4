"""The soil from a table of runs: posterior, drawbar pull and slope, the next measurement."""

from __future__ import annotations

from typing import Any

import numpy as np

from soilml.config.case import Case
from soilml.config.write_case import case_as_toml
from soilml.errors import InputError, SoilmlError
from soilml.experiment_design import Advice
from soilml.experiment_design.advice_after_results import advice_after_fit
from soilml.experiment_design.presentation import abstention_message, next_row_remarks, row_message
from soilml.fitting.coordinates import select_free
from soilml.identification import Fit, identify
from soilml.io.read_table import RUNS, read_table
from soilml.io.table import Table
from soilml.log_import.checks.table_hints import table_remarks
from soilml.numerics.quantiles import QuantileBand, quantile_band
from soilml.quantities import COLUMNS, NOT_IDENTIFIED_ABOVE, QUANTITIES, WEAKLY_IDENTIFIED_ABOVE
from soilml.remarks import Remark, texts
from soilml.report.page import json_text
from soilml.serve.answers.job_files import MODEL_FILE, Tell, page_case, write_files
from soilml.serve.answers.logs import table_summary
from soilml.traction.by_load import LoadPrediction
from soilml.traction.report import PullReport, pull_report
from soilml.traction.rover_presentation import rover_text
from soilml.traction.rover_report import rover_report

#: SI unit -> shown unit and its factor.
SHOWN = {"Pa": ("kPa", 1e-3), "rad": ("°", float(np.rad2deg(1.0))), "m": ("mm", 1e3)}
#: Ends of a 90 % interval as fractions of a distribution.
#: Codes of remarks that stand beside the value of their parameter.
STATED_BESIDE = ("not-identified", "weakly-identified")
_ENDS = np.asarray([0.05, 0.5, 0.95])


def answer(request: dict[str, Any], tell: Tell) -> dict[str, Any]:
    """Estimates with their bands, drawbar pull, advice, warnings and the written files.

    Raises `SoilmlError` as `soilml identify` does; where only the pull or the
    advice cannot be had, the answer says why.
    """
    case = page_case(request)
    tell("reading the table")
    table = read_rows(request)
    remarks = table_remarks(table, case)
    tell(f"estimating the soil from {len(table)} rows")
    fit = identify(case, table)
    tell("looking for the next measurement")
    advice = None if fit.samples is None else advice_after_fit(case, table, None, fit)
    tell("predicting drawbar pull and slope")
    pull = _pull(case, table)
    pull["warnings"] = texts(w for w in pull.get("warnings", []) if w not in fit.warnings)
    found = case.with_values(dict(zip(fit.names, map(float, fit.values), strict=True)))
    rows = f"{fit.rows_used} rows of {table.source}"
    written = {
        "identify.json": json_text(fit.as_json()),
        "model.toml": case_as_toml(found, [f"Soil as estimated from {rows}; priors unchanged."]),
    }
    return {
        **table_summary(table),
        "remarks": texts(remarks),
        "parameters": parameters(case, fit),
        "explanations": [
            {"text": str(one), "probability": one.probability} for one in fit.explanations
        ],
        "words": words(fit, advice),
        "warnings": texts(r for r in fit.warnings if r.code not in STATED_BESIDE),
        "next": "" if advice is None else row_message(advice, advice.best()),
        "misfit": fit.misfit,
        "channels": [COLUMNS[name].name.replace("_", " ") for name in fit.channels],
        "pull": pull,
        "files": write_files(written),
    }


def read_rows(request: dict[str, Any]) -> Table:
    """The rows of a request: all, or those of one run."""
    table = read_table(request["names"][0], RUNS)
    run = request.get("run")
    return table if not run else table.where("run", str(run))


def parameters(case: Case, fit: Fit) -> list[dict[str, Any]]:
    """Each parameter averaged over explanations, by the model taken as exact, and its prior.

    In shown units; `si` is the value in the SI unit.
    """
    priors = {free.path: free.prior for free in select_free(case, None)}
    found = []
    for i, (path, unit) in enumerate(zip(fit.names, fit.units, strict=True)):
        shown, factor = SHOWN.get(unit, ("" if unit == "1" else unit, 1.0))
        prior = priors[path]
        left = fit.remaining_fraction.get(path, float("nan"))
        quantity = QUANTITIES.get(path)
        found.append(
            {
                "path": path,
                "label": path.replace("_", " ").replace(".", " "),
                "symbol": quantity.symbol if quantity else "",
                "unit": shown,
                "value": factor * float(fit.values[i]),
                "std": factor * float(fit.std[i]),
                "band": [factor * float(end[i]) for end in fit.interval],
                "prior": (factor * prior.at(_ENDS)).tolist(),
                "range": [factor * prior.lower, factor * prior.upper],
                "log": prior.log,
                "left": left,
                "identified": not left > NOT_IDENTIFIED_ABOVE,
                "weak": WEAKLY_IDENTIFIED_ABOVE < left <= NOT_IDENTIFIED_ABOVE,
                "si": float(fit.values[i]),
            }
        )
    return found


def words(fit: Fit, advice: Advice | None) -> list[str]:
    """What the rows do not determine, and what to measure next."""
    if advice is not None:
        return texts(next_row_remarks(advice))
    left = fit.remaining_fraction.items()
    return [abstention_message(name, part) for name, part in left if part > NOT_IDENTIFIED_ABOVE]


def _pull(case: Case, table: Table) -> dict[str, Any]:
    """Drawbar pull and slope, of the rover in words; the reason where there is none."""
    try:
        if case.rover is not None:
            return {"text": rover_text(case.rover, rover_report(case, table))}
        if case.gears:
            return pull_of_gears(case, table)
        return pull_curves(pull_report(case, table))
    except SoilmlError as error:
        return {"reason": " ".join(str(error).split())}


def pull_curves(report: PullReport) -> dict[str, Any]:
    """The curves of each load, with pull in N and slope in degrees."""
    slip, load, pull = report.measured_pull
    return {
        "loads": [_curves(one) for one in report.by_load],
        "measured": {"slip": slip.tolist(), "load": load.tolist(), "pull": pull.tolist()},
        "warnings": list(report.warnings),
    }


def pull_of_gears(case: Case, table: Table) -> dict[str, Any]:
    """The curves of each gear that was driven, on the soil that its own rows show.

    Raises `InputError` where rows do not name their gear.
    """
    if "gear" not in table:
        raise InputError(f"{MODEL_FILE} has several gears, and the table no column gear")
    text = "the soil below each wheel is that of its own rows"
    own_soil = Remark("soil-per-gear", text, tuple(case.gears), "note")
    loads, warnings = [], [own_soil]
    for name in case.gears:
        rows = table.rows(table["gear"] == name)
        if len(rows):
            own = pull_curves(pull_report(case.of_gear(name), rows))
            loads += [one | {"gear": name, "measured": own["measured"]} for one in own["loads"]]
            warnings += own["warnings"]
    if not loads:
        raise InputError(f"no row has a gear of {MODEL_FILE}: {', '.join(case.gears)}")
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
