"""What an identification says: of one fit, and of the fits of groups of rows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from soilml.parameters import declared
from soilml.physics.soils import Soil
from soilml.report.column_figure import ParameterIntervals, corner_picture
from soilml.report.numbers import channel_name, format_quantity
from soilml.report.report import Report, by_group
from soilml.report.tables import Column, ReportTable

if TYPE_CHECKING:
    from soilml.config.case import Case
    from soilml.identification.fit import Fit

_NOTATION = (
    ("+-", "one standard deviation of the error that is expected."),
    ("90 %", "interval that covers the value with that probability, by model and noise."),
    ("left of prior", "width of the estimate over that of the prior; blank without one."),
)
_LEAST_SHARE = 0.01  # Probability of an explanation below which it is not listed
TO_NEXT = "soilml plan next proposes the rows to measure next"
TO_GAP = "soilml gap finds what a model lacks"


def fit_report(fit: Fit, title: str = "Soil") -> Report:
    """The report of one fit: verdict, soil, readings beside the model, what limits it."""
    details = []
    if fit.explanations:
        shown = sorted(fit.explanations, key=lambda one: -one.probability)
        said = [
            f"{one}: {format_quantity(one.probability, 'share', digits=2)}"
            for one in shown
            if one.probability >= _LEAST_SHARE
        ]
        details.append(("Explanations that the intervals average over", said))
    pictures = [] if fit.curves is None else [fit.curves().picture()]
    if fit.draws is not None:
        pictures.append(corner_picture(fit.names, fit.units, fit.draws))
    left = fit.remaining_fraction
    known = len(fit.names) - len(fit.undetermined)
    status = "identified" if known == len(fit.names) else "partly identified"
    status = "not identified" if not known else status
    return Report(
        kind="identify",
        verdict=fit.verdict,
        figures=ReportTable.of_parameters(
            "Soil",
            fit.frame_columns(),
            left_of_prior=Column(
                "left of prior", [left.get(n) for n in fit.names], "share", digits=2
            ),
        ),
        pictures=pictures or [_intervals({"": fit}).picture()],
        remarks=fit.warnings,
        next_steps=[TO_NEXT, TO_GAP] if fit.fits and fit.undetermined else [TO_GAP],
        details=details,
        status=status if fit.fits else "the model does not fit",
        tone="bad" if not fit.fits else "good" if known == len(fit.names) else "warn",
        title=title,
        basis=f"{fit.rows_used} rows; method {fit.method}; channels: "
        f"{', '.join(map(channel_name, fit.channels))}",
        notation=_NOTATION,
    )


def group_report(
    found: Mapping[str, Fit], failed: Mapping[str, str], by: str, title: str = "Soil by group"
) -> Report:
    """The report of fits by group of the rows; `failed` says why others fail."""
    fits = sum(fit.fits for fit in found.values())
    verdict = f"The model fits the rows of {fits} of {len(found)} groups by {by}."
    if fits < len(found):
        verdict = f"{verdict[:-1]}: run `soilml gap`."
    whole = by_group({n: fit_report(f) for n, f in found.items()}, failed, by, verdict, title)
    return replace(whole, pictures=[_intervals(found).picture()])


def _intervals(found: Mapping[str, Fit]) -> ParameterIntervals:
    """Values and 90 % intervals of groups."""
    fits = list(found.values())
    ends = np.asarray([fit.interval for fit in fits])
    none = np.full(len(fits[0].names), np.nan)
    return ParameterIntervals(
        fits[0].names, fits[0].units, list(found), np.asarray([fit.values for fit in fits]),
        ends[:, 0], ends[:, 1], none, none,
    )  # fmt: skip


def soil_entries(case: Case, fit: Fit, with_draws: bool) -> dict[str, Any]:
    """Entries of the file with which other programs know the whole soil, in SI units.

    `model` has the effects and every parameter of the soil, at its value in the model file where it
    was not identified. `draws` has equally likely values of the identified ones, where the method
    drew samples and `with_draws`.
    """
    known = {name: float(getattr(case.soil, name)) for name in declared(Soil)}
    found = dict(zip(fit.names, fit.values.tolist(), strict=True))
    soil = {name: found.get(name, value) for name, value in known.items()}
    effects = [effect.name for effect in case.model.effects]
    entries: dict[str, Any] = {"model": {"soil": soil, "effects": effects}}
    if with_draws and fit.draws is not None:
        entries["draws"] = {
            name: [float(f"{value:.7g}") for value in fit.draws[:, i]]
            for i, name in enumerate(fit.names)
        }
    return entries
