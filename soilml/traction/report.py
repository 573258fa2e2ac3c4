"""The report of pull and slopes of a wheel or a rover: tables, pictures and what limits them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from soilml.arrays import Floats
from soilml.numerics.quantiles import band_columns, quantile_band
from soilml.quantities import NOT_IDENTIFIED_ABOVE
from soilml.remarks import Remark
from soilml.report.column_figure import column_picture
from soilml.report.numbers import format_quantity, format_range, significant
from soilml.report.report import Picture, Report
from soilml.report.tables import Column, ReportTable
from soilml.results import Result
from soilml.traction.prediction import FEWEST, SAME_LOAD, MeasuredRange, TractionPrediction

STEP = 2  # Tables show every second slip
_NOTATION = (
    ("90 %", "from the 5 % to the 95 % quantile; medians before them."),
    ("climbed", "share of the soils, which the rows allow, on which the slope is climbed."),
    ("margin", "largest pull less the weight along the slope."),
    ("efficiency", "power at the drawbar over that of the drives, on level ground."),
)


@dataclass(frozen=True, repr=False)
class PullReport(Result):
    """Predictions of a rover, or of a wheel under each load.

    rows: Number of rows.
    measured_range: Slips and loads of the rows.
    by_load: Prediction under each load; one for a rover.
    measured_pull: Slip, load (N) and drawbar pull (N) of the k rows that measured it, (k,) each.
    warnings: Those that hold for all.
    of_rover: Whether they are of a rover.
    """

    rows: int
    measured_range: MeasuredRange
    by_load: list[TractionPrediction]
    measured_pull: tuple[Floats, Floats, Floats]
    warnings: tuple[Remark, ...]
    of_rover: bool = False

    @property
    def vague(self) -> list[bool]:
        """Whether largest pull and steepest slope of each are no better known than before."""
        return [
            share > NOT_IDENTIFIED_ABOVE for o in self.by_load for share in o.remaining_fraction
        ]

    def frame_columns(self) -> dict[str, Any]:
        """Medians and ends of 90 % bands, SI units: a row for each slope of a rover.

        Of a wheel: a row for each load and slip, with what it does on each slope in all of a load.
        """
        if self.of_rover:
            one = self.by_load[0]
            return _in_all_rows(_slope_columns(one), _vehicle_columns(one))
        return _of_loads(
            self.by_load,
            lambda one: _in_all_rows(
                _curve_columns(one), _vehicle_columns(one) | _on_each_slope(one)
            ),
        )

    def report(self, title: str = "Drawbar pull and slopes") -> Report:
        """Largest pull and steepest slope, curves and slopes, and what limits them."""
        vague = self.vague
        moves = [one.posterior.still_fraction <= FEWEST for one in self.by_load]
        under: dict[Remark, list[str]] = {}
        for one in self.by_load:
            for remark in one.warnings:
                under.setdefault(remark, []).append(significant(one.vehicle.weight))
        heads = {r: "" if self.of_rover else f"{', '.join(n)} N: " for r, n in under.items()}
        sentences = [_sentence(one, self.of_rover) for one in self.by_load]
        slips = format_range(*self.measured_range.slip, digits=2)
        loads = format_range(*self.measured_range.load)
        status, tone = "predicted", "good"
        if any(vague):
            status, tone = "not known" if all(vague) else "partly known", "warn"
        if not all(moves):
            status, tone = "moves under some loads" if any(moves) else "does not move", "bad"
        return Report(
            kind="pull",
            verdict=sentences[0],
            lines=[*sentences[1:], *(_lines(self.by_load[0]) if len(sentences) == 1 else ())],
            tables=list(self._tables()),
            pictures=self._pictures(),
            remarks=[*(r.under(head) for r, head in heads.items()), *self.warnings],
            next_steps=[
                "measure a row at another load and slip: soilml plan next finds the best one"
            ],
            status=status,
            tone=tone,
            title=title,
            basis=f"{self.rows} row{'s'[: self.rows != 1]} at slips {slips}, loads {loads} N",
            notation=_NOTATION,
        )

    def _tables(self) -> Iterator[ReportTable]:
        if self.of_rover:
            yield _table_of_slopes(self.by_load[0])
            yield from _table_of_wheels(self.by_load[0])
            return
        yield _table_of_loads(self.by_load)
        columns = _of_loads(self.by_load, _curve_columns)
        kept = [np.arange(len(one.posterior.curve_slip)) % STEP == STEP - 1 for one in self.by_load]
        shown = np.flatnonzero(np.concatenate(kept))
        known = ("load_N", "slip", "drawbar_pull_N", "tractive_efficiency", "sinkage_m")
        own = {
            name: np.asarray(values)[shown]
            for name, values in columns.items()
            if name.removesuffix("_p05").removesuffix("_p95") in known
        }
        yield ReportTable.of("Pull on level ground", own)
        for one in self.by_load:
            yield _table_of_slopes(one, f" under {significant(one.vehicle.weight)} N")

    def _pictures(self) -> list[Picture]:
        several = ("load_N",) if len(self.by_load) > 1 else ()
        slopes = column_picture(
            _hidden_where_not_climbed(self.by_load),
            "slope_rad",
            [("slip",), ("margin_N",), ("energy_J_per_m",), ("probability_climbed",)],
            several,
            title="On slopes",
            caption="Lines: medians. Bands: 90 % of the soils that the rows allow.",
        )
        if self.of_rover:
            return [slopes]
        slip, load, pull = self.measured_pull
        columns = _of_loads(self.by_load, _curve_columns)
        if not several:
            near = np.abs(load / self.by_load[0].vehicle.weight - 1.0) < SAME_LOAD
            slip, pull = slip[near], pull[near]
        else:
            columns = {name: values for name, values in columns.items() if "_prior" not in name}
        driven = format_range(*self.measured_range.slip, digits=2)
        curves = column_picture(
            columns,
            "slip",
            [("drawbar_pull_N",), ("tractive_efficiency",), ("sinkage_m",)],
            several,
            title="Pull, efficiency and sinkage over slip",
            caption="Lines: medians. Bands: 90 % of the soils that the rows allow; grey: of the "
            f"prior. Points: measured pull. Slips {driven} were measured.",
            measured={"slip": slip, "drawbar_pull_N": pull},
        )
        return [curves, slopes]


def _of_loads(
    loads: Sequence[TractionPrediction], columns: Callable[[TractionPrediction], dict[str, Any]]
) -> dict[str, Any]:
    """Columns of each load below each other."""
    parts = []
    for one in loads:
        own = columns(one)
        count = len(next(iter(own.values())))
        parts.append({"load_N": np.full(count, one.vehicle.weight)} | own)
    return {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}


def _in_all_rows(columns: Mapping[str, Any], numbers: Mapping[str, Any]) -> dict[str, Any]:
    """The columns, and further ones of the same number in all rows."""
    count = len(next(iter(columns.values())))
    return {**columns, **{name: np.full(count, value) for name, value in numbers.items()}}


def _curve_columns(one: TractionPrediction) -> dict[str, Any]:
    """A row for each slip on level ground."""
    known = one.posterior
    columns: dict[str, Any] = {"slip": known.curve_slip}
    for name, values in (
        ("drawbar_pull_N", known.pull),
        ("tractive_efficiency", known.efficiency),
        ("sinkage_m", known.deepest),
        ("drawbar_pull_N_prior", one.prior.pull),
    ):
        columns |= band_columns(name, values)
    return columns


def _slope_columns(one: TractionPrediction) -> dict[str, Any]:
    """A row for each slope; of several wheels, also what each does."""
    own = one.posterior
    columns: dict[str, Any] = {"slope_rad": own.slope, "probability_climbed": own.climbed}
    for name, draws in (
        ("slip", own.slip),
        ("margin_N", own.margin),
        ("energy_J_per_m", own.energy),
    ):
        columns |= band_columns(name, draws)
    for name in own.loads if len(own.loads) > 1 else ():
        columns[f"load_N_{name}"] = own.loads[name]
        columns[f"torque_Nm_{name}"] = quantile_band(own.torque[name]).middle
        columns[f"sinkage_m_{name}"] = quantile_band(own.sinkage[name]).middle
    return columns


def _vehicle_columns(one: TractionPrediction) -> dict[str, Any]:
    """What belongs to the vehicle, numbers."""
    known, prior = one.posterior, one.prior
    columns: dict[str, Any] = {}
    for name, values in (
        ("largest_drawbar_pull_N", known.largest_pull),
        ("strongest_slip", known.strongest_slip),
        ("best_slip", known.best_slip),
        ("best_efficiency", known.best_efficiency),
        ("steepest_slope_rad", known.steepest_slope),
        ("largest_drawbar_pull_N_prior", prior.largest_pull),
        ("steepest_slope_rad_prior", prior.steepest_slope),
    ):
        columns |= band_columns(name, values)
    pull, slope = one.remaining_fraction
    columns["largest_drawbar_pull_remaining_fraction"] = pull
    columns["steepest_slope_remaining_fraction"] = slope
    return columns


def _on_each_slope(one: TractionPrediction) -> dict[str, Any]:
    """The columns of slopes as one for each slope, numbers."""
    own, columns = _slope_columns(one), {}
    for i, slope in enumerate(np.rad2deg(own.pop("slope_rad"))):
        for name, values in own.items():
            start, ending, _ = name.partition("_p05" if name.endswith("_p05") else "_p95")
            columns[f"{start}_at_{slope:g}_deg{ending}"] = values[i]
    return columns


def _hidden_where_not_climbed(loads: Sequence[TractionPrediction]) -> Mapping[str, Any]:
    """The columns of slopes, with slip and work blank where hardly any soil lets it climb."""
    columns = _of_loads(loads, _slope_columns)
    enough = columns["probability_climbed"] >= FEWEST
    shown = ("load_N", "slope", "prob", "margin")
    return {
        name: np.where(enough | name.startswith(shown), values, np.nan)
        for name, values in columns.items()
    }


def _sentence(one: TractionPrediction, of_rover: bool) -> str:
    """Largest pull and steepest slope, with 90 % bands where the rows tell them."""
    own = one.posterior
    who = "The rover" if of_rover else f"At {significant(one.vehicle.weight)} N the wheel"
    if own.still_fraction > FEWEST:
        share = format_quantity(own.still_fraction, "share", digits=2)
        return f"{who} does not move: {share} of the soils do not let it."
    unknown = {"N": "an unknown force", "rad": "an unknown slope"}
    pull, slope = (
        unknown[unit] if share > NOT_IDENTIFIED_ABOVE else quantile_band(draws).text(unit)
        for draws, unit, share in zip(
            (own.largest_pull, own.steepest_slope), unknown, one.remaining_fraction, strict=True
        )
    )
    if of_rover:
        return f"The rover climbs {slope} at slips up to {own.slip_limit:.2g}."
    return f"{who} pulls {pull} at most and climbs {slope}."


def _lines(one: TractionPrediction) -> Iterator[str]:
    """Where the drives are used best, and what was known before the rows."""
    own = one.posterior
    if own.still_fraction > FEWEST:
        return
    if np.isfinite(own.best_slip).any():
        best = quantile_band(own.best_efficiency).text(digits=2)
        slip = quantile_band(own.best_slip).text()
        yield f"The best slip on level ground is {slip}, with an efficiency of {best}."
    if np.isfinite(one.prior.steepest_slope).any():
        before = quantile_band(one.prior.steepest_slope).text("rad")
        yield f"Before the rows, the steepest slope was {before}."


def _table_of_loads(loads: Sequence[TractionPrediction]) -> ReportTable:
    known = [one.posterior for one in loads]
    pulls = [quantile_band(one.prior.largest_pull) for one in loads]
    steepest = [quantile_band(k.steepest_slope) for k in known]
    return ReportTable(
        "By load",
        [
            Column("load", [one.weight for one in known], "N"),
            Column.of_bands("largest pull", [quantile_band(k.largest_pull) for k in known], "N"),
            Column.of_bands("steepest slope", steepest, "rad"),
            Column.of_bands(
                "slip of the largest pull",
                [quantile_band(k.strongest_slip) for k in known],
                digits=2,
            ),
            Column.of_bands("pull before the rows", pulls, "N"),
        ],
    )


def _table_of_slopes(one: TractionPrediction, under: str = "") -> ReportTable:
    own, enough = one.posterior, one.posterior.climbed >= FEWEST
    blank = np.where(enough, 0.0, np.nan)
    columns = [
        Column("slope", own.slope.tolist(), "rad", digits=3),
        Column("climbed", own.climbed.tolist(), "share", digits=3),
    ]
    for head, draws, unit, hidden in (
        ("slip", own.slip, "1", blank),
        ("margin", own.margin, "N", 0.0),
        ("work", own.energy, "J/m", blank),
    ):
        band = quantile_band(draws)
        ends = ((band.lower + hidden).tolist(), (band.upper + hidden).tolist())
        columns.append(Column(head, (band.middle + hidden).tolist(), unit, ends=ends))
    return ReportTable(f"Slopes{under}", columns)


def _table_of_wheels(one: TractionPrediction) -> Iterator[ReportTable]:
    """Loads, torques and sinkages on the steepest of the slopes that most draws climb."""
    own = one.posterior
    climbed = np.flatnonzero(own.climbed >= FEWEST)
    if not climbed.size:
        return
    at = int(climbed[-1])
    torque = [quantile_band(own.torque[name][:, at]) for name in own.loads]
    sinkage = [quantile_band(own.sinkage[name][:, at]) for name in own.loads]
    passes = [int(others["pass_number"]) for _, others in one.vehicle.wheels.values()]
    yield ReportTable(
        f"Wheels on {format_quantity(float(own.slope[at]), 'rad')}",
        [
            Column("wheel", list(own.loads)),
            Column("pass", passes),
            Column("load", [float(load[at]) for load in own.loads.values()], "N"),
            Column.of_bands("torque", torque, "N m"),
            Column.of_bands("sinkage", sinkage, "m"),
        ],
    )
