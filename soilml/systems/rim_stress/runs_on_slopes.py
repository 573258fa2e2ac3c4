"""Shear modulus of each run of a wheel with measured stress, and pull and slope by one of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from soilml.arrays import Floats
from soilml.errors import FitError, InputError
from soilml.physics.model import Model
from soilml.physics.operating_point import MOST_SLIP, Operating
from soilml.physics.soils import Soil
from soilml.quantities import Z_90
from soilml.remarks import Remark
from soilml.report.column_figure import column_picture
from soilml.report.numbers import format_quantity
from soilml.report.report import Report
from soilml.report.tables import ReportTable
from soilml.systems.rim_stress.force_balance import SteadyRun, WheelBalance, unit_remarks
from soilml.systems.rim_stress.stress import (
    MeasuredStress,
    SensingWheel,
    StressProfile,
    deconvolve,
    fit_stress_arc,
)

DRAWS = 64  # Draws of the errors of each run, from which standard deviations follow
#: Standard deviation of ln k_x for stress shapes that `deconvolve` does not represent: skewed
#: parabolas and Bekker's wedges were recovered within 3 %.
SHAPE_STD = 0.015
#: Slip up to which a k_x of small slip holds (Table I); saturated share of samples that is told.
MAX_VALID_SLIP, MAX_SATURATED = 0.5, 0.01


ENDS = ((5, -Z_90), (95, Z_90))  # Per cent below the ends of 90 % intervals, and their deviations
#: Columns of each panel of the picture; the last is fig. 7 of the source.
PANELS = (
    ("shear_modulus_m",),
    ("drawbar_pull_N", "pull_on_slope_N", "pull_by_bekker_N"),
    ("slope_climbed_rad", "slope_rad", "slope_by_bekker_rad"),
)


@dataclass(frozen=True)
class RunsOnSlopes:
    """What the force balance of each run gives.

    columns: A row for each run by names of columns: its k_x, m, and M, the true over the measured
        stress; pull and slope climbed by the k_x of the reference run, beside those that the slope
        requires and, with a model, those by its own stress, Bekker's. NaN where there is none.
        Standard deviations `_std` have the errors of the stress and the declared ones of slip,
        weight and slope, of both runs.
    reference: The run whose k_x predicts.
    """

    columns: dict[str, Any]
    reference: str
    warnings: tuple[Remark, ...]

    def report(self, title: str = "Pull of a wheel from the stress on its rim") -> Report:
        """How well one k_x predicts the pulls that the slopes require, then a row for each run."""
        columns, k = self.columns, self.columns["run"].index(self.reference)
        others = np.asarray(columns["run"]) != self.reference
        off = columns["drawbar_pull_N"] - columns["pull_on_slope_N"]
        within = np.abs(off) < Z_90 * columns["drawbar_pull_N_std"]
        modulus, std = columns["shear_modulus_m"][k], columns["shear_modulus_m_std"][k]
        verdict = f"The k_x of run {self.reference} is {format_quantity(modulus, 'm', std)}"
        lines = []
        if others.any():
            verdict += (
                f"; the pull that the slope requires is in the 90 % interval of "
                f"{int((within & others).sum())} of {int(others.sum())} other runs"
            )
        if "pull_by_bekker_N" in columns and others.any():
            own = columns["pull_by_bekker_N"] - columns["pull_on_slope_N"]
            by_stress, by_bekker = (
                format_quantity(float(np.sqrt(np.nanmean(each[others] ** 2))), "N")
                for each in (off, own)
            )
            lines = [
                f"The pull of the others is off by {by_stress}, that of Bekker's stress by "
                f"{by_bekker}."
            ]
        panels = [tuple(name for name in panel if name in columns) for panel in PANELS]
        return Report(
            kind="sensor-wheel",
            verdict=f"{verdict}.",
            lines=lines,
            tables=[ReportTable.of("Runs", columns)],
            pictures=[column_picture(columns, "slip", panels, title="k_x, pull, slope")],
            remarks=self.warnings,
            title=title,
        )


def solve_runs(
    runs: Mapping[str, SteadyRun],
    stresses: Mapping[str, MeasuredStress],
    wheel: SensingWheel,
    soil: Soil,
    reference: str | None = None,
    *,
    discs: bool = False,
    model: Model | None = None,
) -> RunsOnSlopes:
    """Solve the balance of each run for k_x, and predict pull and slope with that of one run.

    One k_x serves up to a slip of about 0.5. Standard deviations are over draws of the stress,
    and of slip, weight and slope where their errors are declared; k_x is taken as lognormal. Errors
    of the soil's strength are not included.

    Parameters
    ----------
    runs
        Slip, weight and slope of each run.
    stresses
        Measured stress on the rim, by run.
    wheel, soil
        Radius, width and sensors of the wheel; cohesion and friction angle of the soil.
    reference
        The run whose k_x predicts; by default the one of the least slope.
    discs
        Whether the averaging over round sensors is removed.
    model
        Wheel whose own stress on the soil gives the conventional pull beside.

    Raises
    ------
    InputError
        For a run without stress, and a reference that is none of the runs.
    FitError
        If the reference run has no solution, and for readings that are no single arc.

    References
    ----------
    Nagatani et al. 2009, section V, eqs. 14 and 15, and fig. 7 (slope against slip).
    """
    if missing := [name for name in runs if name not in stresses]:
        raise InputError(
            f"run {missing[0]} has no stress: give its rows of angle_rad and normal_Pa"
        )
    if reference is None:
        reference = min(runs, key=lambda name: abs(float(runs[name].slope)))
    if reference not in runs:
        raise InputError(f"no run {reference!r}; there are: {', '.join(runs)}")
    balance, rng, why = WheelBalance.of(wheel, soil), np.random.default_rng(0), dict[str, str]()
    shape = _normal(rng, 1)[:, 0] * (SHAPE_STD if discs else 0.0)
    drawn = [
        _drawn(at, profiles(stresses[name], wheel if discs else None, rng), rng)
        for name, at in runs.items()
    ]
    # by run and draw, of which the first is what was measured: k_x; pull and slope by that of the
    # reference
    solved = np.full((len(runs), DRAWS + 1), np.nan)
    predicted = np.full((len(runs), DRAWS + 1, 2), np.nan)
    for k, name in enumerate(runs):
        for i, own in enumerate(drawn[k]):
            try:
                solved[k, i] = balance.modulus(*own)
            except FitError as error:
                if i == 0:
                    why[name] = str(error)
                    break
    if reference in why:
        raise FitError(f"run {reference}, the reference: {why[reference]}")
    solved[:, 1:] *= np.exp(shape)
    known = solved[list(runs).index(reference)]
    for k, each in enumerate(drawn):
        for i, own in enumerate(each):
            pull = balance.on_slopes(*own, known[i])
            predicted[k, i] = pull.pull(float(own[1].slope)), pull.equilibrium_slope()
    modulus, (pulls, slopes) = solved[:, 0], np.moveaxis(predicted[:, 0], 1, 0)
    pull_std = _std(predicted[:, 1:, 0])
    slip = np.asarray([float(at.slip) for at in runs.values()])
    load = np.asarray([at.load for at in runs.values()])
    columns: dict[str, Any] = {
        "run": list(runs),
        "slip": slip,
        "shear_modulus_m": modulus,
        "shear_modulus_m_std": modulus * _std(np.log(solved[:, 1:])),
        "drawbar_pull_N": pulls,
        "drawbar_pull_N_std": pull_std,
        "pull_on_slope_N": np.asarray([at.required for at in runs.values()]),
        "slope_climbed_rad": slopes,
        "slope_climbed_rad_std": _std(predicted[:, 1:, 1]),
        "slope_rad": np.asarray([float(at.slope) for at in runs.values()]),
    }
    if model is not None:
        by_bekker = np.asarray(model(soil, Operating(slip=slip, load=load)).drawbar_pull)
        columns |= {"pull_by_bekker_N": by_bekker}
        columns |= {"slope_by_bekker_rad": np.arctan2(by_bekker, load)}
    columns["magnification"] = np.asarray(
        [balance.magnification(*each[0], k) for each, k in zip(drawn, modulus, strict=True)]
    )
    columns |= {f"drawbar_pull_N_p{at:02d}": pulls + z * pull_std for at, z in ENDS}
    warnings = _warnings(runs, stresses, columns["magnification"], why, discs)
    return RunsOnSlopes(columns, reference, warnings)


def profiles(
    stress: MeasuredStress, discs: SensingWheel | None, rng: np.random.Generator
) -> list[StressProfile]:
    """The profile as measured, and `DRAWS` times with the errors of its points drawn anew.

    Of the round sensors `discs` the averaging is removed (`deconvolve`).
    """
    noise = _normal(rng, len(stress.normal)) * stress.std
    drawn = np.maximum(np.vstack([stress.normal, stress.normal + noise]), 0.0)
    if discs is None:
        return [StressProfile(stress.angle, normal) for normal in drawn]
    start = fit_stress_arc(stress, discs)
    return [deconvolve(replace(stress, normal=normal), discs, start) for normal in drawn]


def _normal(rng: np.random.Generator, count: int) -> Floats:
    """Normal numbers (DRAWS, count) whose sample means are 0 and sample variances 1."""
    z = rng.standard_normal((DRAWS, count))
    return np.asarray((z - z.mean(axis=0)) / z.std(axis=0, ddof=1))


def _drawn(
    at: SteadyRun, stresses: list[StressProfile], rng: np.random.Generator
) -> list[tuple[StressProfile, SteadyRun]]:
    """Stress and run as measured, and `DRAWS` times with their errors."""
    runs = [at]
    for normal in _normal(rng, 3):
        moved = {
            name: float(getattr(at, name)) + float(getattr(at, f"{name}_std")) * z
            for name, z in zip(("slip", "weight", "slope"), normal.tolist(), strict=True)
        }
        moved["slip"] = float(np.clip(moved["slip"], -MOST_SLIP, MOST_SLIP))
        runs.append(replace(at, **moved))
    return list(zip(stresses, runs, strict=True))


def _std(drawn: Floats) -> Floats:
    """Standard deviation (runs,) over the draws (runs, draws) with a solution; NaN below two."""
    enough = np.isfinite(drawn).sum(axis=1) > 1
    filled = np.where(enough[:, None], drawn, 0.0)
    return np.where(enough, np.nanstd(filled, axis=1, ddof=1), np.nan)


def _warnings(
    runs: Mapping[str, SteadyRun],
    stresses: Mapping[str, MeasuredStress],
    scale: Floats,
    why: Mapping[str, str],
    discs: bool,
) -> tuple[Remark, ...]:
    """Limits of the data that a user should know."""
    found = [Remark("no-solution", f"run {n} has no k_x: {text}", (n,)) for n, text in why.items()]
    found += unit_remarks(scale)
    if not discs:
        text = (
            "the stress is used as given: where round sensors averaged it over their disc, k_x is "
            "too large (by 14 % on the wheel of the source); --diameter removes that"
        )
        found.append(Remark("uncorrected", text, severity="note"))
    fast = [name for name, at in runs.items() if float(at.slip) > MAX_VALID_SLIP]
    if fast:
        text = (
            f"the slip of run {', '.join(fast)} exceeds {MAX_VALID_SLIP:g}: measurements show that "
            "a shear modulus of small slip does not apply there"
        )
        found.append(Remark("outside-valid-slip", text, tuple(fast)))
    full = [name for name in runs if stresses[name].saturated > MAX_SATURATED]
    if full:
        text = (
            f"samples of run {', '.join(full)} are saturated: the peak of the stress is inferred "
            "from its flanks"
        )
        found.append(Remark("saturated", text, tuple(full)))
    return tuple(found)
