"""Pull and slope as columns, and what is said and shown of them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from soilml.numerics.quantiles import quantile_band
from soilml.physics.pull_efficiency import traffic_class
from soilml.quantities import NOT_IDENTIFIED_ABOVE
from soilml.remarks import Remark
from soilml.report.column_figure import column_picture
from soilml.report.numbers import format_band, format_quantity, format_range, significant
from soilml.report.report import Picture, Report
from soilml.report.tables import Column, ReportTable
from soilml.traction.by_load import SAME_LOAD, LoadPrediction
from soilml.traction.pull_and_slope import Traction
from soilml.traction.report import PullReport

STEP = 2  # Tables show every second slip
_NOTATION = (
    ("90 %", "from the 5 % to the 95 % quantile; medians before them."),
    ("tractive efficiency", "power at the drawbar over that of the drive."),
    ("pull efficiency", "share of the thrust that is left as pull; class by 35, 50, 65 %."),
)


def pull_columns(found: PullReport) -> dict[str, Any]:
    """A row for each load and slip, in SI units; what belongs to a load stands in all its rows."""
    parts = [_columns(one) for one in found.by_load]
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
    finite = np.isfinite(middle)
    probability = np.where(finite, (each == usual).mean(axis=0), np.nan)
    return {"traffic_class": np.where(finite, usual, ""), "traffic_class_probability": probability}


def band_columns(name: str, draws: Any) -> dict[str, Any]:
    """Columns of the median and the 90 % band of draws along the first axis."""
    band = quantile_band(draws)
    return {name: band.middle, f"{name}_p05": band.lower, f"{name}_p95": band.upper}


def report_of_pull(found: PullReport, title: str = "Drawbar pull and slope") -> Report:
    """The report of a prediction for one gear."""
    loads = found.by_load
    slips = format_range(*found.measured_range.slip, digits=2)
    columns = pull_columns(found)
    shown = np.arange(len(columns["slip"]))
    shown = shown[_every_second(found)]
    names = ["load_N", "slip", "drawbar_pull_N", "slope_rad"]
    use = ["load_N", "slip", "tractive_efficiency", "pull_efficiency", "traffic_class"]
    use += ["traffic_class_probability"]
    tables = [_by_load(found)]
    for head, of in (("Pull and slope", names), ("Efficiency", use)):
        if head == "Efficiency" and all(one.posterior.most_efficient is None for one in loads):
            continue
        wanted = [
            n for n in columns if n in of or n.removesuffix("_p05").removesuffix("_p95") in of
        ]
        tables.append(ReportTable.of(head, {n: np.asarray(columns[n])[shown] for n in wanted}))
    tables += [one.laws.table() for one in loads if one.laws is not None]
    vague = [share > NOT_IDENTIFIED_ABOVE for one in loads for share in one.remaining_fraction]
    sentences = [_sentence(one) for one in loads]
    under: dict[Remark, list[str]] = {}
    for one in loads:
        for remark in one.warnings:
            under.setdefault(remark, []).append(significant(one.posterior.load))
    remarks = [remark.under(f"{', '.join(names)} N: ") for remark, names in under.items()]
    return Report(
        kind="pull",
        verdict=sentences[0],
        lines=[*sentences[1:], *(_efficiency(loads[0].posterior) if len(loads) == 1 else ())],
        tables=tables,
        pictures=[_picture(found)],
        remarks=[*remarks, *found.warnings],
        next_steps=["measure a row at another load and slip: soilml plan next finds the best one"],
        status="not known" if all(vague) else "partly known" if any(vague) else "predicted",
        tone="warn" if any(vague) else "good",
        title=title,
        basis=f"{found.rows} row{'s'[: found.rows != 1]} at slips {slips}",
        notation=_NOTATION,
    )


def _every_second(found: PullReport) -> Any:
    """Which rows of the columns tables show, (rows,)."""
    kept = [np.arange(len(one.posterior.slip)) % STEP == STEP - 1 for one in found.by_load]
    return np.concatenate(kept)


def _sentence(one: LoadPrediction) -> str:
    """Largest pull and steepest slope under a load, with 90 % bands where the rows tell them."""
    known = one.posterior
    unknown = {"N": "an unknown force", "rad": "an unknown slope"}
    said = [
        unknown[unit] if share > NOT_IDENTIFIED_ABOVE else format_band(*_ends(draws), unit)
        for draws, unit, share in zip(
            (known.largest_pull, known.steepest_slope), unknown, one.remaining_fraction, strict=True
        )
    ]
    return f"At {significant(known.load)} N the wheel pulls {said[0]} at most and climbs {said[1]}."


def _ends(draws: Any) -> tuple[float, float, float]:
    band = quantile_band(draws)
    return float(band.lower), float(band.middle), float(band.upper)


def _efficiency(known: Traction) -> Iterator[str]:
    """Both efficiencies, and the class, where the drive is used best."""
    i = known.most_efficient
    if i is None:
        return
    tractive, pull = (
        format_band(*_ends(v[:, i]), digits=2)
        for v in (known.tractive_efficiency, known.pull_efficiency)
    )
    where = f"{known.slip[i]:.2g}"
    yield f"Tractive efficiency is best at slip {where}: {tractive}; pull efficiency {pull}."
    found = _classes(known)
    share = format_quantity(float(found["traffic_class_probability"][i]), "share", digits=2)
    yield f"Traffic class there: {found['traffic_class'][i]}, on {share} of the soils."


def _by_load(found: PullReport) -> ReportTable:
    known = [one.posterior for one in found.by_load]
    pulls = [quantile_band(one.prior.largest_pull) for one in found.by_load]
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


def _picture(found: PullReport) -> Picture:
    slip, load, pull = found.measured_pull
    columns = pull_columns(found)
    if len(found.by_load) == 1:
        near = np.abs(load / found.by_load[0].posterior.load - 1.0) < SAME_LOAD
        slip, pull = slip[near], pull[near]
    else:
        columns = {name: values for name, values in columns.items() if "_prior" not in name}
    panels = [("drawbar_pull_N",), ("slope_rad",), ("tractive_efficiency", "pull_efficiency")]
    slips = format_range(*found.measured_range.slip, digits=2)
    return column_picture(
        columns,
        "slip",
        panels,
        ("load_N",) if len(found.by_load) > 1 else (),
        title="Pull, slope and efficiency over slip",
        caption="Lines: medians. Bands: 90 % of the soils that the rows allow; grey: of the prior. "
        f"Points: measured pull. Slips {slips} were measured.",
        measured={"slip": slip, "drawbar_pull_N": pull},
    )
