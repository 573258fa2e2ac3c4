"""What `climb` says: the steepest slope, the soil, and pull and slope over slip."""

from __future__ import annotations

import numpy as np

from soilml.numerics.quantiles import QuantileBand, quantile_band
from soilml.remarks import about
from soilml.report.numbers import format_band
from soilml.report.report import Picture, Report
from soilml.report.tables import Column, ReportTable
from soilml.systems.climbing.report import FIGURE_SIZE, ClimbingReport

SLIPS = 9  # Slips of the curve in its table


def report_of_climbs(found: ClimbingReport, title: str = "Slopes that a rover climbs") -> Report:
    """The report of the climbs of a rover."""
    fit, ability = found.ground.fit, found.ability
    verdict = f"The rover climbs {_band(quantile_band(ability.steepest), 'rad')}."
    lines = [f"That is at slip {_band(quantile_band(ability.steepest_slip))}."]
    if found.slip_limit is not None:
        within = _band(quantile_band(ability.steepest_within(found.slip_limit)), "rad")
        lines.append(f"At slips up to {found.slip_limit:g} it climbs {within}.")
    left = [fit.remaining_fraction.get(name) for name in fit.names]
    vague = about(found.warnings, "not-identified")
    at = np.linspace(0, len(ability.slip) - 1, SLIPS).astype(int)
    curve = ReportTable.of(
        "Pull and slope over slip",
        {
            "slip": ability.slip[at],
            **{
                f"{name}{end}": getattr(band, part)[at]
                for name, band in (("drawbar_pull_N", found.pull), ("slope_rad", found.slope))
                for end, part in (("", "middle"), ("_p05", "lower"), ("_p95", "upper"))
            },
        },
    )
    climbs, slopes = fit.rows_used, found.ground.distinct_slopes
    return Report(
        kind="climb",
        verdict=verdict,
        lines=lines,
        figures=ReportTable.of_parameters(
            "Soil",
            fit.frame_columns(),
            left_of_prior=Column("left of prior", left, "share", digits=2),
        ),
        tables=[curve],
        pictures=[
            Picture(
                "Pull and slope over slip",
                found.plot,
                1,
                2,
                FIGURE_SIZE,
                verdict,
                "Lines: medians, with bands of 90 %. Dots: the climbs, at the mean slip of both "
                "wheels.",
            )
        ],
        remarks=found.warnings,
        next_steps=["climb a steeper slope within the band, and run the command again"],
        status="partly known" if vague else "predicted",
        tone="warn" if vague else "good",
        title=title,
        basis=f"{climbs} climb{'s'[: climbs != 1]} on {slopes} slope{'s'[: slopes != 1]}",
        notation=[("90 %", "from the 5 % to the 95 % quantile; medians before them.")],
    )


def _band(found: QuantileBand, unit: str = "1") -> str:
    return format_band(float(found.lower), float(found.middle), float(found.upper), unit)
