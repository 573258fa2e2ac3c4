"""Pull and slope as text, as columns, and as a page."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import pi
from pathlib import Path
from typing import Any, Generic, Protocol, TypeVar

import numpy as np

from soilml.io.text_tables import format_table
from soilml.numerics.quantiles import QuantileBand, quantile_band
from soilml.physics.pull_efficiency import traffic_class
from soilml.quantities import NOT_IDENTIFIED_ABOVE
from soilml.remarks import Remark
from soilml.report import numbers
from soilml.report.figure_style import picture
from soilml.report.page import Report, ReportPicture, ReportTable
from soilml.report.terminal import significant
from soilml.traction.by_load import LoadPrediction
from soilml.traction.pull_and_slope import Traction
from soilml.traction.report import ROWS, PullReport, figure_size

#: The printed curve has every second slip.
PRINTED_STEP = 2
DEGREES = 180.0 / pi


class Plotted(Protocol):
    """A result that draws itself."""

    def plot(self, ax: Any = None) -> Any:
        """Draw into axes."""


Result = TypeVar("Result", bound=Plotted)


@dataclass(frozen=True)
class Presentation(Generic[Result]):
    """What one kind of result is written as."""

    columns: Callable[[Result], Mapping[str, Any]]  # The CSV table of a result, in SI units
    text: Callable[[Result], str]  # Tables and warnings for a terminal
    warnings: Callable[[Result], Sequence[Remark]]  # The warnings alone
    # The page of results by group, the column of the groups, model file and table
    page: Callable[[Mapping[str, Result], str | None, tuple[str, str]], Report]
    # Rows and columns of axes that `plot` takes, and the size of the figure, inches
    panels: Callable[[Result], tuple[int, int, tuple[float, float]]]


def pull_columns(report: PullReport) -> dict[str, Any]:
    """A row for each load and slip, in SI units; what belongs to a load stands in all its rows."""
    parts = [_columns(one) for one in report.by_load]
    return {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}


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
    told = np.isfinite(middle)
    probability = np.where(told, (each == usual).mean(axis=0), np.nan)
    return {"traffic_class": np.where(told, usual, ""), "traffic_class_probability": probability}


def band_columns(name: str, draws: Any) -> dict[str, Any]:
    """Columns of the median and the 90 % band of draws along the first axis."""
    band = quantile_band(draws)
    return {name: band.middle, f"{name}_p05": band.lower, f"{name}_p95": band.upper}


def pull_warnings(report: PullReport) -> list[Remark]:
    """Warnings of each load, then those of the whole result."""
    by_load = [(f"{one.posterior.load:.4g} N: ", one.warnings) for one in report.by_load]
    own = [remark.under(head) for head, remarks in by_load for remark in remarks]
    return [*own, *report.warnings]


def pull_text(report: PullReport) -> str:
    """A table for each load, the largest pull, the steepest slope, and the warnings."""
    slips, loads = report.measured_range.slip, report.measured_range.load
    head = (
        f"{report.rows} row{'s'[: report.rows > 1]} at slips {slips[0]:.2g} to {slips[1]:.2g}, "
        f"loads {loads[0]:.4g} to {loads[1]:.4g} N"
    )
    parts = [head, *(_load_text(one) for one in report.by_load)]
    parts += [one.laws.text() for one in report.by_load if one.laws is not None]
    return "\n\n".join([*parts, "\n".join(f"! {text}" for text in report.warnings)])


def _load_text(one: LoadPrediction) -> str:
    known, prior, (no_pull, no_slope) = one.posterior, one.prior, _not_known(one)
    header = (
        "slip", "pull_N", "p05", "p95", "pull/load", "slope_deg", "p05", "p95",
        "prior_p05_N", "prior_p95_N",
    )  # fmt: skip
    lines = [
        (slip, *pull, f"{middle / known.load:.2f}", *slope, *before)
        for (slip, pull, slope, before), middle in zip(
            _curve(one), _printed(quantile_band(known.pull).middle), strict=True
        )
    ]
    pulled = _value(quantile_band(known.largest_pull), 1.0, no_pull)
    climbed = _value(quantile_band(known.steepest_slope), DEGREES, no_slope)
    best = [
        f"largest pull    {pulled} N, at slip {_slips(quantile_band(known.best_slip))}; "
        f"before the rows {_range(quantile_band(prior.largest_pull), 1.0)} N",
        f"steepest slope  {climbed} deg, at slip {_slips(quantile_band(known.steepest_slip))}; "
        f"before the rows {_range(quantile_band(prior.steepest_slope), DEGREES)} deg",
    ]
    doubts = [f"! {text}" for text in one.warnings]
    table = format_table(header, lines, text_columns=0)
    return "\n".join([f"load {known.load:.4g} N", table, *best, *_efficiency(known), *doubts])


def load_sentence(one: LoadPrediction) -> str:
    """Largest pull and steepest slope under a load, with 90 % bands."""
    known, (no_pull, no_slope) = one.posterior, _not_known(one)
    pulled = _value(quantile_band(known.largest_pull), 1.0, no_pull)
    climbed = _value(quantile_band(known.steepest_slope), DEGREES, no_slope)
    return f"At {known.load:.4g} N the wheel pulls {pulled} N at most and climbs {climbed} deg."


def _efficiency(known: Traction) -> list[str]:
    """Both efficiencies, and the class, where the drive is used best."""
    i = known.most_efficient
    if i is None:
        return []
    both = [quantile_band(v[:, i]) for v in (known.tractive_efficiency, known.pull_efficiency)]
    tractive, pull = (f"{b.middle:.2f} ({b.lower:.2f} to {b.upper:.2f})" for b in both)
    classes = _classes(known)
    share = f"{classes['traffic_class_probability'][i]:.0%}"
    return [
        f"efficiency      tractive {tractive} at slip {known.slip[i]:.2g}, its best; pull {pull}",
        f"traffic class   {classes['traffic_class'][i]} there, as on {share} of the soils",
    ]


def _not_known(one: LoadPrediction) -> list[bool]:
    """Whether pull and slope are no better known than before the rows."""
    return [share > NOT_IDENTIFIED_ABOVE for share in one.remaining_fraction]


def _printed(values: Any) -> Any:
    """Every second one of the values along the curve."""
    return values[PRINTED_STEP - 1 :: PRINTED_STEP]


def _curve(one: LoadPrediction) -> Iterator[tuple[str, list[str], list[str], list[str]]]:
    """Slip; middle and ends of pull (N) and of slope (degrees); ends of the prior's pull."""
    known = one.posterior
    pull, slope, before = map(quantile_band, (known.pull, known.slope, one.prior.pull))
    parts = [known.slip, pull.middle, pull.lower, pull.upper]
    parts += [DEGREES * v for v in (slope.middle, slope.lower, slope.upper)]
    for slip, *values in zip(*map(_printed, [*parts, before.lower, before.upper]), strict=True):
        cells = [f"{value:.1f}" for value in values]
        yield f"{slip:.3g}", cells[:3], cells[3:6], cells[6:]


def _value(found: QuantileBand, factor: float, unknown: bool = False, unit: str = "") -> str:
    middle = "not known" if unknown else f"{factor * float(found.middle):.1f}{unit}"
    return f"{middle} ({_range(found, factor)})"


def _range(found: QuantileBand, factor: float) -> str:
    return f"{factor * float(found.lower):.1f} to {factor * float(found.upper):.1f}"


def _slips(found: QuantileBand) -> str:
    low, middle, high = (f"{float(v):.2g}" for v in (found.lower, found.middle, found.upper))
    return middle if low == high else f"{middle} ({low} to {high})"


def pull_page(found: Mapping[str, PullReport], by: str | None, files: tuple[str, str]) -> Report:
    """The page of `pull` for one gear: predictions by group; model file and table."""
    answer, rows, use, known = [], [], [], []
    for name, report in found.items():
        for one in report.by_load:
            head = f"{by} {name}, " if by else ""
            pulled = _value(quantile_band(one.posterior.largest_pull), 1.0, unit=" N")
            climbed = _value(quantile_band(one.posterior.steepest_slope), DEGREES, unit="°")
            no_pull, no_slope = (
                "is not known better than before the rows" if vague else "is"
                for vague in _not_known(one)
            )
            known += [not any(_not_known(one))]
            answer.append(
                f"{numbers.capitalised(head)}{significant(one.posterior.load)} N: the largest pull "
                f"{no_pull} {pulled}, the steepest slope {no_slope} {climbed}."
            )
            use += [([name] if by else []) + row for row in _efficiency_rows(one.posterior)]
            rows += [([name] if by else []) + row for row in _page_rows(one)]
    header = ["load, N", "slip", "pull, N", "90 %", "slope, °", "90 %", "pull before, N (90 %)"]
    first = next(iter(found.values()))
    images = [
        ReportPicture(
            f"Pull and slope over slip{f', {by} {name}' if by else ''}",
            picture(report.plot, ROWS, len(report.by_load), figure_size(report), answer[0]),
            "Lines: medians. Bands: 90 % of the soils that the rows allow (blue) and of those of "
            "the prior (grey). Dashed: pull efficiency, with the ends of its classes (dotted).",
        )
        for name, report in list(found.items())[:MOST_PICTURES]
    ]
    warnings = [
        remark.under(f"{by} {name}: ") if by else remark
        for name, report in found.items()
        for remark in pull_warnings(report)
    ]
    count = sum(report.rows for report in found.values())
    badge = "predicted" if all(known) else "partly known" if any(known) else "not known"
    return Report(
        kind="pull",
        title=f"Drawbar pull and slope on the soil of {Path(files[1]).name}",
        badge=badge,
        meaning=f"from {count} row{'s'[: count != 1]} at slips {first.measured_range.slip[0]:.2g} "
        f"to {first.measured_range.slip[1]:.2g}, by the model {Path(files[0]).name}",
        answer=answer[:MOST_SENTENCES],
        tone="named" if all(known) else "suspected",
        pictures=images,
        tables=[
            ReportTable(caption, [*([by] if by else []), *names], cells, 1 + bool(by))
            for caption, names, cells in (
                ("Pull and slope", header, rows),
                ("Efficiency", EFFICIENCIES, use),
            )
            if cells
        ],
        warnings=warnings,
        next_steps=[
            "Drive a row at another load and slip: soilml plan next says which narrows it most."
        ],
        notation=[
            ("90 %", "from the 5 % to the 95 % quantile; medians before them."),
            ("tractive efficiency", "power at the drawbar over that of the drive."),
            ("pull efficiency", "share of the thrust that is left as pull; class by 35, 50, 65 %."),
        ],
    )


EFFICIENCIES = (
    *("load, N", "slip", "tractive efficiency", "90 %", "pull efficiency", "90 %"),
    *("traffic class", "of the soils"),
)


def _efficiency_rows(known: Traction) -> list[list[str]]:
    """Both efficiencies and the class at each printed slip; none for a leg."""
    if known.most_efficient is None:
        return []
    classes = _classes(known)
    both = [quantile_band(v) for v in (known.tractive_efficiency, known.pull_efficiency)]
    rows = []
    for i in range(PRINTED_STEP - 1, len(known.slip), PRINTED_STEP):
        cells = [significant(known.load), f"{known.slip[i]:.3g}"]
        for band in both:
            cells += [f"{band.middle[i]:.2f}", f"{band.lower[i]:.2f} to {band.upper[i]:.2f}"]
        share = f"{classes['traffic_class_probability'][i]:.0%}"
        rows.append([c.replace("-", "−") for c in cells] + [classes["traffic_class"][i], share])
    return rows


#: Most pictures and sentences of a page; the table has the rest.
MOST_PICTURES, MOST_SENTENCES = 6, 6


def _page_rows(one: LoadPrediction) -> list[list[str]]:
    load, rows = significant(one.posterior.load), []
    for slip, pull, slope, before in _curve(one):
        ends = [" to ".join(values) for values in (pull[1:], slope[1:], before)]
        cells = [load, slip, pull[0], ends[0], slope[0], ends[1], ends[2]]
        rows.append([cell.replace("-", "−") for cell in cells])
    return rows


PRESENTATION = Presentation(
    columns=pull_columns,
    text=pull_text,
    warnings=pull_warnings,
    page=pull_page,
    panels=lambda report: (ROWS, len(report.by_load), figure_size(report)),
)
