"""Shear modulus of each run of a wheel with measured stress, and pull and slope by one of them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from soilml.arrays import Floats, Real
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
from soilml.systems.rim_stress.force_balance import (
    MohrCoulomb,
    SlopePull,
    SteadyRun,
    find_modulus,
    force_components,
    magnification,
    pull_under,
    unit_remarks,
)
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


#: Columns of each panel of the picture; the last is fig. 7 of the source.
PANELS = (
    ("shear_modulus_m",),
    ("drawbar_pull_N", "pull_on_slope_N", "pull_by_bekker_N"),
    ("slope_climbed_rad", "slope_rad", "slope_by_bekker_rad"),
)


@dataclass(frozen=True)
class RunsOnSlopes:
    """What the force balance of each run gives, arrays (runs,); NaN where it has no solution.

    shear_modulus: k_x, m. magnification: True over measured stress, M.
    drawbar_pull: Predicted by the k_x of the reference run, N.
    climbed: Slope that the wheel climbs at this slip by that k_x, rad.
    conventional: Drawbar pull of the model on its own stress, Bekker's, N; None without a model.
    Standard deviations `_std` have the errors of the stress and the declared ones of slip, weight
    and slope, of both runs.
    """

    at: Mapping[str, SteadyRun]
    shear_modulus: Floats
    shear_modulus_std: Floats
    magnification: Floats
    drawbar_pull: Floats
    drawbar_pull_std: Floats
    climbed: Floats
    climbed_std: Floats
    conventional: Floats | None
    reference: str
    warnings: tuple[Remark, ...]

    @property
    def columns(self) -> dict[str, Any]:
        """A row for each run, by names of columns."""
        pull, std = self.drawbar_pull, self.drawbar_pull_std
        runs = self.at.values()
        weight, slope, slip = (
            np.asarray([float(getattr(at, name)) for at in runs])
            for name in ("weight", "slope", "slip")
        )
        found = {
            "run": list(self.at),
            "slip": slip,
            "shear_modulus_m": self.shear_modulus,
            "shear_modulus_m_std": self.shear_modulus_std,
            "drawbar_pull_N": pull,
            "drawbar_pull_N_std": std,
            "pull_on_slope_N": weight * np.sin(slope),
            "slope_climbed_rad": self.climbed,
            "slope_climbed_rad_std": self.climbed_std,
            "slope_rad": slope,
        }
        if self.conventional is not None:
            angle = np.arctan2(self.conventional, weight * np.cos(slope))
            found |= {"pull_by_bekker_N": self.conventional, "slope_by_bekker_rad": angle}
        found["magnification"] = self.magnification
        found["drawbar_pull_N_p05"] = pull - Z_90 * std
        found["drawbar_pull_N_p95"] = pull + Z_90 * std
        return found

    def report(self, title: str = "Pull of a wheel from the stress on its rim") -> Report:
        """How well one k_x predicts the pulls that the slopes require, then a row for each run."""
        columns = self.columns
        needed, pull = columns["pull_on_slope_N"], self.drawbar_pull
        others = np.asarray([name != self.reference for name in self.at])
        within = np.abs(pull - needed) < Z_90 * self.drawbar_pull_std
        verdict = f"The k_x of run {self.reference} is {self._modulus}"
        if others.any():
            verdict += (
                f"; the pull that the slope requires is in the 90 % interval of "
                f"{int((within & others).sum())} of {int(others.sum())} other runs"
            )
        lines = []
        if self.conventional is not None and others.any():
            off, own = (
                format_quantity(float(np.sqrt(np.nanmean((v - needed)[others] ** 2))), "N")
                for v in (pull, self.conventional)
            )
            lines = [f"The pull of the others is off by {off}, that of Bekker's stress by {own}."]
        return Report(
            kind="sensor-wheel",
            verdict=f"{verdict}.",
            lines=lines,
            tables=[ReportTable.of("Runs", columns)],
            pictures=[column_picture(columns, "slip", PANELS, title="k_x, pull, slope")],
            remarks=self.warnings,
            title=title,
        )

    @property
    def _modulus(self) -> str:
        k = list(self.at).index(self.reference)
        value, std = float(self.shear_modulus[k]), float(self.shear_modulus_std[k])
        return format_quantity(value, "m", std)


def solve_runs(
    runs: Mapping[str, SteadyRun],
    stresses: Mapping[str, MeasuredStress],
    wheel: SensingWheel,
    strength: MohrCoulomb,
    reference: str | None = None,
    *,
    discs: bool = False,
    model: tuple[Model, Soil] | None = None,
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
    wheel, strength
        Radius, width and sensors of the wheel; cohesion and friction angle of the soil.
    reference
        The run whose k_x predicts; by default the one of the least slope.
    discs
        Whether the averaging over round sensors is removed.
    model
        Wheel and soil whose own stress gives the conventional pull beside.

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
    rng, why = np.random.default_rng(0), dict[str, str]()
    cohesion, tangent = float(strength.cohesion), math.tan(float(strength.friction_angle))
    shape = _normal(rng, 1)[:, 0] * (SHAPE_STD if discs else 0.0)

    def parts(profile: StressProfile, at: SteadyRun, modulus: Real) -> Floats:
        size = float(wheel.radius), float(wheel.width)
        return force_components(profile, float(at.slip), modulus, *size)

    def load(at: SteadyRun) -> float:
        return float(at.weight) * math.cos(float(at.slope))

    def balance(profile: StressProfile, at: SteadyRun) -> float:
        def pull(modulus: Floats) -> Floats:
            return np.asarray(pull_under(parts(profile, at, modulus), load(at), cohesion, tangent))

        return find_modulus(pull, float(at.weight) * math.sin(float(at.slope)))

    drawn = {
        name: _drawn(at, profiles(stresses[name], wheel if discs else None, rng), rng)
        for name, at in runs.items()
    }
    solved = np.full((len(runs), DRAWS + 1), np.nan)  # the first draw is what was measured
    for k, name in enumerate(runs):
        for i, (profile, at) in enumerate(drawn[name]):
            try:
                solved[k, i] = balance(profile, at)
            except FitError as error:
                if i == 0:
                    why[name] = str(error)
                    break
    if reference in why:
        raise FitError(f"run {reference}, the reference: {why[reference]}")
    solved[:, 1:] *= np.exp(shape)
    known = solved[list(runs).index(reference)]
    # (runs, draws, 2): pull and slope by the k_x of the reference
    predicted = np.full((len(runs), DRAWS + 1, 2), np.nan)
    scale = np.full(len(runs), np.nan)
    for k, name in enumerate(runs):
        for i, (profile, at) in enumerate(drawn[name]):
            each = parts(profile, at, known[i])
            steep = SlopePull.of_wheel(each, float(at.weight), cohesion, tangent)
            predicted[k, i] = steep.pull(float(at.slope)), steep.equilibrium_slope()
        profile, at = drawn[name][0]
        if name not in why:
            scale[k] = magnification(parts(profile, at, solved[k, 0]), load(at), cohesion, tangent)
    own = None
    if model is not None:
        slip = np.asarray([float(at.slip) for at in runs.values()])
        under = Operating(slip=slip, load=np.asarray([load(at) for at in runs.values()]))
        own = np.asarray(model[0](model[1], under).drawbar_pull)
    modulus = solved[:, 0]
    return RunsOnSlopes(
        at=runs,
        shear_modulus=modulus,
        shear_modulus_std=modulus * _std(np.log(solved[:, 1:])),
        magnification=scale,
        drawbar_pull=predicted[:, 0, 0],
        drawbar_pull_std=_std(predicted[:, 1:, 0]),
        climbed=predicted[:, 0, 1],
        climbed_std=_std(predicted[:, 1:, 1]),
        conventional=own,
        reference=reference,
        warnings=_warnings(runs, stresses, scale, why, discs),
    )


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
