"""Pull and slope of one gear from a case and a table of rows: prediction, columns, report."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from soilml.arrays import Floats
from soilml.config.given_case import GivenCase, as_case
from soilml.fitting.operating_points import operating_points
from soilml.io.read_table import Rows, as_table
from soilml.numerics.quantiles import band_columns, quantile_band
from soilml.physics.operating_point import COVARIATES
from soilml.physics.pull_efficiency import traffic_class
from soilml.physics.soils.gravity_law import GravityChange
from soilml.quantities import NOT_IDENTIFIED_ABOVE, column
from soilml.remarks import Remark
from soilml.report.column_figure import column_picture
from soilml.report.numbers import format_quantity, format_range, significant
from soilml.report.report import Picture, Report
from soilml.report.tables import Column, ReportTable
from soilml.results import Result
from soilml.traction.gravity import gravity_remark
from soilml.traction.measured_range import (
    SAME_LOAD,
    MeasuredRange,
    band_content,
    measured_loads,
    slip_grid,
)
from soilml.traction.pull_and_slope import (
    LoadPrediction,
    Traction,
    excluded_effects,
    predictions_by_load,
)
from soilml.traction.soil_draws import measured_soil

STEP = 2  # Tables show every second slip
#: Loads down to this share of the smallest are in the range of the errors: those on a slope.
ON_SLOPES = 0.5
NOT_INCLUDED = "all wheels equal, no load transfer, no side slope"  # What no band includes
_NOTATION = (
    ("90 %", "from the 5 % to the 95 % quantile; medians before them."),
    ("tractive efficiency", "power at the drawbar over that of the drive."),
    ("pull efficiency", "share of the thrust that is left as pull; class by 35, 50, 65 %."),
)


@dataclass(frozen=True, repr=False)
class PullReport(Result):
    """Predictions under each load.

    rows: Number of rows.
    measured_range: Slips and loads of the rows.
    by_load: Prediction under each load.
    measured_pull: Slip, load (N) and drawbar pull (N) of the k rows that measured it, (k,) each.
    warnings: Those that hold for all loads.
    """

    rows: int
    measured_range: MeasuredRange
    by_load: list[LoadPrediction]
    measured_pull: tuple[Floats, Floats, Floats]
    warnings: tuple[Remark, ...]

    @property
    def vague(self) -> list[bool]:
        """Whether largest pull and steepest slope of each load are no better known than before."""
        return [
            share > NOT_IDENTIFIED_ABOVE for o in self.by_load for share in o.remaining_fraction
        ]

    def frame_columns(self) -> dict[str, Any]:
        """A row for each load and slip: medians and 90 % bands, what belongs to a load in all."""
        parts = [_columns(one) for one in self.by_load]
        return {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}

    def report(self, title: str = "Drawbar pull and slope") -> Report:
        """Largest pull and steepest slope under each load, their curves, and what limits them."""
        loads, columns = self.by_load, self.frame_columns()
        kept = [np.arange(len(one.posterior.slip)) % STEP == STEP - 1 for one in loads]
        shown = np.flatnonzero(np.concatenate(kept))
        tables = [_table_of_loads(loads)]
        heads = {"Pull and slope": r"drawbar_pull_N|slope_rad"}
        if any(one.posterior.most_efficient is not None for one in loads):
            heads["Efficiency"] = r"tractive_efficiency|pull_efficiency|traffic_class\w*"
        for head, names in heads.items():
            of = re.compile(rf"(load_N|slip|{names})(_p05|_p95)?")
            own = {n: np.asarray(v)[shown] for n, v in columns.items() if of.fullmatch(n)}
            tables.append(ReportTable.of(head, own))
        sentences = [_sentence(one) for one in loads]
        under: dict[Remark, list[str]] = {}
        for one in loads:
            for remark in one.warnings:
                under.setdefault(remark, []).append(significant(one.posterior.load))
        remarks = [remark.under(f"{', '.join(names)} N: ") for remark, names in under.items()]
        vague = self.vague
        slips = format_range(*self.measured_range.slip, digits=2)
        return Report(
            kind="pull",
            verdict=sentences[0],
            lines=[*sentences[1:], *(_efficiency(loads[0].posterior) if len(loads) == 1 else ())],
            tables=tables,
            pictures=[self._picture(columns)],
            remarks=[*remarks, *self.warnings],
            next_steps=[
                "measure a row at another load and slip: soilml plan next finds the best one"
            ],
            status="not known" if all(vague) else "partly known" if any(vague) else "predicted",
            tone="warn" if any(vague) else "good",
            title=title,
            basis=f"{self.rows} row{'s'[: self.rows != 1]} at slips {slips}",
            notation=_NOTATION,
        )

    def _picture(self, columns: dict[str, Any]) -> Picture:
        slip, load, pull = self.measured_pull
        if len(self.by_load) == 1:
            near = np.abs(load / self.by_load[0].posterior.load - 1.0) < SAME_LOAD
            slip, pull = slip[near], pull[near]
        else:
            columns = {name: values for name, values in columns.items() if "_prior" not in name}
        slips = format_range(*self.measured_range.slip, digits=2)
        return column_picture(
            columns,
            "slip",
            [("drawbar_pull_N",), ("slope_rad",), ("tractive_efficiency", "pull_efficiency")],
            ("load_N",) if len(self.by_load) > 1 else (),
            title="Pull, slope and efficiency over slip",
            caption="Lines: medians. Bands: 90 % of the soils that the rows allow; grey: of the "
            f"prior. Points: measured pull. Slips {slips} were measured.",
            measured={"slip": slip, "drawbar_pull_N": pull},
        )


def pull_report(
    case: GivenCase,
    table: Rows,
    *,
    free: Sequence[str] | None = None,
    loads: Sequence[float] | None = None,
    slip_limit: float | None = None,
    exact_model: bool = False,
    gravity: GravityChange | None = None,
) -> PullReport:
    """Pull and slope of a gear on the soil that the rows were measured on.

    Parameters
    ----------
    case
        Model, soil, priors and noise, or the path of a model file.
    table
        Measured rows of one soil, as for `identify`. Speed, pass number and slip angle of the
        prediction are their medians.
    free
        Paths of the unknown parameters; by default those with a prior.
    loads
        Vertical loads, N; by default those of the rows.
    slip_limit
        Highest slip, in (0, 1); by default the highest measured one, at least 0.6.
    exact_model
        Whether the soil is that of the model taken as exact, and not averaged over explanations as
        in `identify`.
    gravity
        Gravity of the rows and of the prediction, with a law of the soil; loads are those of the
        prediction. By default both are the same.

    Returns
    -------
    PullReport
        Draws of pull (N) and slope (rad) under each load, for the posterior and the prior.

    Raises
    ------
    InputError
        For a load that the soil does not carry, or a slip limit outside (0, 1).
    FitError, TableError
        As `identify`.
    """
    case, table = as_case(case), as_table(table)
    soil = measured_soil(case, table, free, exact_model)
    case, warnings = soil.case, [*soil.warnings, *excluded_effects(soil.case)]
    table = table.rows(table.answered)
    at = operating_points(table)
    measured_range = MeasuredRange.of(table["slip"], table["load_N"])
    covariates = {
        field: float(np.median(values))
        for field in COVARIATES
        if (values := getattr(at, field)) is not None
    }
    loads = measured_loads(table["load_N"]) if loads is None else loads
    slip = slip_grid(slip_limit, measured_range)
    asked = [*loads, ON_SLOPES * min(loads)]
    draws, before = soil.with_errors(slip, asked, ("drawbar_pull",))
    predictions = predictions_by_load(
        case, draws, before, loads, slip, measured_range, covariates, gravity
    )
    if gravity is not None and gravity.ratio != 1.0:
        warnings.append(gravity_remark(gravity))
    key = column("drawbar_pull")
    pull = table[key] if key in table else np.full(len(table), np.nan)
    known = np.isfinite(pull)
    measured_pull = table["slip"][known], table["load_N"][known], pull[known]
    return PullReport(
        len(table),
        measured_range,
        predictions,
        measured_pull,
        (*warnings, band_content(before.errors, NOT_INCLUDED)),
    )


def _columns(one: LoadPrediction) -> dict[str, Any]:
    known, prior = one.posterior, one.prior
    count = len(known.slip)
    columns = {"load_N": np.full(count, known.load), "slip": known.slip}
    for name, values in (
        ("drawbar_pull_N", known.pull),
        ("slope_rad", known.slope),
        ("largest_drawbar_pull_N", known.largest_pull),
        ("best_slip", known.best_slip),
        ("steepest_slope_rad", known.steepest_slope),
        ("tractive_efficiency", known.tractive_efficiency),
        ("pull_efficiency", known.pull_efficiency),
        ("sinkage_m", known.sinkage),
    ):
        columns |= {k: np.broadcast_to(v, count) for k, v in band_columns(name, values).items()}
    columns |= _classes(known)
    before = quantile_band(prior.pull), quantile_band(prior.slope)
    for name, found in zip(("drawbar_pull_N", "slope_rad"), before, strict=True):
        columns[f"{name}_prior_p05"], columns[f"{name}_prior_p95"] = found.lower, found.upper
    for name, share in zip(
        ("largest_drawbar_pull", "steepest_slope"), one.remaining_fraction, strict=True
    ):
        columns[f"{name}_remaining_fraction"] = np.full(count, share)
    return columns


def _classes(known: Traction) -> dict[str, Any]:
    """The traffic class of the median pull efficiency at each slip, and the soils that share it."""
    middle = quantile_band(known.pull_efficiency).middle
    usual, each = traffic_class(middle), traffic_class(known.pull_efficiency)
    finite = np.isfinite(middle)
    probability = np.where(finite, (each == usual).mean(axis=0), np.nan)
    return {"traffic_class": np.where(finite, usual, ""), "traffic_class_probability": probability}


def _sentence(one: LoadPrediction) -> str:
    """Largest pull and steepest slope under a load, with 90 % bands where the rows tell them."""
    known = one.posterior
    unknown = {"N": "an unknown force", "rad": "an unknown slope"}
    said = [
        unknown[unit] if share > NOT_IDENTIFIED_ABOVE else quantile_band(draws).text(unit)
        for draws, unit, share in zip(
            (known.largest_pull, known.steepest_slope), unknown, one.remaining_fraction, strict=True
        )
    ]
    return f"At {significant(known.load)} N the wheel pulls {said[0]} at most and climbs {said[1]}."


def _efficiency(known: Traction) -> Iterator[str]:
    """Both efficiencies, and the class, where the drive is used best."""
    i = known.most_efficient
    if i is None:
        return
    tractive, pull = (
        quantile_band(v[:, i]).text(digits=2)
        for v in (known.tractive_efficiency, known.pull_efficiency)
    )
    where = f"{known.slip[i]:.2g}"
    yield f"Tractive efficiency is best at slip {where}: {tractive}; pull efficiency {pull}."
    found = _classes(known)
    share = format_quantity(float(found["traffic_class_probability"][i]), "share", digits=2)
    yield f"Traffic class there: {found['traffic_class'][i]}, on {share} of the soils."


def _table_of_loads(loads: Sequence[LoadPrediction]) -> ReportTable:
    known = [one.posterior for one in loads]
    pulls = [quantile_band(one.prior.largest_pull) for one in loads]
    return ReportTable(
        "By load",
        [
            Column("load", [one.load for one in known], "N"),
            Column.of_bands("largest pull", [quantile_band(k.largest_pull) for k in known], "N"),
            Column.of_bands(
                "steepest slope", [quantile_band(k.steepest_slope) for k in known], "rad"
            ),
            Column.of_bands("at slip", [quantile_band(k.best_slip) for k in known], digits=2),
            Column.of_bands("pull before the rows", pulls, "N"),
        ],
    )
