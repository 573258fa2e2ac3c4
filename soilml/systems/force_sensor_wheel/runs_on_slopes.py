"""Shear modulus of each run of a wheel with measured stress, and the pull that one predicts."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from soilml.arrays import Floats
from soilml.errors import FitError, InputError, TableError
from soilml.io.table import Table
from soilml.physics.operating_point import MOST_SLIP
from soilml.systems.force_sensor_wheel.deconvolution import deconvolve, fit_stress_arc
from soilml.systems.force_sensor_wheel.force_balance import (
    MohrCoulomb,
    SteadyRun,
    solve_force_balance,
    solve_vertical_balance,
)
from soilml.systems.force_sensor_wheel.sensor_readings import BinnedStress, SensingWheel
from soilml.systems.force_sensor_wheel.stress_profile import StressProfile

#: Draws of the errors of each run, from which standard deviations follow.
DRAWS = 64
#: Fewest points of a profile whose scatter tells its noise; 20 is the variance of the third
#: difference of unit noise, 0.798 the mean size of a standard normal number.
_FEWEST, _THIRD, _MEAN = 8, 20.0, 0.798


@dataclass(frozen=True)
class MeasuredStress:
    """Normal stress on the rim (points,), Pa, with its standard deviation.

    `discs` is the wheel whose round sensors averaged the stress; None where it is taken as given.
    """

    angle: Floats
    normal: Floats
    std: Floats
    discs: SensingWheel | None = None

    def profiles(self, draws: int, rng: np.random.Generator) -> list[StressProfile]:
        """The profile as measured, and as many with the errors of its points drawn anew."""
        noise = rng.standard_normal((draws, len(self.normal))) * self.std
        drawn = np.maximum(np.vstack([self.normal, self.normal + noise]), 0.0)
        if self.discs is None:
            return [StressProfile(self.angle, normal) for normal in drawn]
        # of a mean over a disc below twice the deadband, some samples may have read nothing
        inside = self.normal * self.discs.area > 2.0 * float(self.discs.deadband)
        binned = [BinnedStress(self.angle, one, inside, saturated_fraction=0.0) for one in drawn]
        start = fit_stress_arc(binned[0], self.discs)
        return [deconvolve(one, self.discs, start) for one in binned]


def _noise(normal: Floats) -> Floats:
    """Standard deviation (points,) by the scatter about a smooth course, a share of the stress."""
    if len(normal) < _FEWEST or not normal.any():
        return np.zeros(len(normal))
    level = np.convolve(normal, np.full(4, 0.25), "valid")
    share = np.abs(np.diff(normal, 3))[level > 0.0] / level[level > 0.0]
    return np.asarray(float(np.mean(share)) / math.sqrt(_THIRD) / _MEAN * normal)


@dataclass(frozen=True)
class RunsOnSlopes:
    """What the force balance of each run gives, all arrays (runs,); NaN where it has no solution.

    shear_modulus, shear_modulus_std: k_x, m, and its standard deviation by the errors of the
        stress and the declared ones of slip, weight and slope.
    magnification: True over measured stress, M.
    drawbar_pull, drawbar_pull_std: Predicted by the k_x of the reference run, N; errors of both
        runs.
    required: Pull that the slope requires, N.
    reference: The run whose k_x predicts.
    why: Reasons by run without a solution.
    """

    runs: tuple[str, ...]
    shear_modulus: Floats
    shear_modulus_std: Floats
    magnification: Floats
    drawbar_pull: Floats
    drawbar_pull_std: Floats
    required: Floats
    reference: str
    why: Mapping[str, str]


def read_stresses(stresses: Table, discs: SensingWheel | None = None) -> dict[str, MeasuredStress]:
    """The stress of each run from rows of `run`, `angle_rad`, `normal_Pa`, in any order.

    Its standard deviation is the column `normal_Pa_std`, else follows from the scatter of
    neighbouring points. Raises `TableError` for a run whose rows are no profile, or too few to
    remove the averaging of round sensors (`discs`).
    """
    found: dict[str, MeasuredStress] = {}
    for name, rows in stresses.groups():
        order = np.argsort(rows["angle_rad"], kind="stable")
        angle, normal = rows["angle_rad"][order], rows["normal_Pa"][order]
        std = rows["normal_Pa_std"][order] if "normal_Pa_std" in rows else _noise(normal)
        found[name] = MeasuredStress(angle, normal, std, discs)
        try:
            StressProfile(angle, normal)
            found[name].profiles(0, np.random.default_rng(0))
        except (FitError, InputError) as error:
            raise TableError(f"{stresses.source}: run {name}: {error}") from None
    return found


def solve_runs(
    runs: Mapping[str, SteadyRun],
    stresses: Mapping[str, MeasuredStress],
    wheel: SensingWheel,
    strength: MohrCoulomb,
    reference: str | None = None,
) -> RunsOnSlopes:
    """Solve the balance of each run for k_x, and predict all pulls with that of one run.

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
        Radius and width of the wheel; cohesion and friction angle of the soil, which are known.
    reference
        The run whose k_x predicts; by default the one of the least slope.

    Raises
    ------
    InputError
        For a run without stress, and a reference that is none of the runs.
    FitError
        If the reference run has no solution.

    References
    ----------
    Nagatani et al. 2009, section V, eqs. 14 and 15.
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
    drawn = {name: _drawn(runs[name], stresses[name], rng) for name in runs}
    # (runs, draws, 2): k_x and M; the first draw is what was measured
    solved = np.full((len(runs), DRAWS + 1, 2), np.nan)
    for k, name in enumerate(runs):
        for i, (profile, at) in enumerate(drawn[name]):
            try:
                found = solve_force_balance(profile, at, wheel, strength)
                solved[k, i] = found.shear_modulus, found.magnification
            except FitError as error:
                if i == 0:
                    why[name] = str(error)
                    break
    if reference in why:
        raise FitError(f"run {reference}, the reference: {why[reference]}")
    known = solved[list(runs).index(reference), :, 0]
    pull = np.asarray(
        [
            [
                float(solve_vertical_balance(profile, at, wheel, strength, known[i : i + 1])[1][0])
                for i, (profile, at) in enumerate(drawn[name])
            ]
            for name in runs
        ]
    )
    modulus = solved[:, 0, 0]
    required = [float(at.weight) * np.sin(float(at.slope)) for at in runs.values()]
    return RunsOnSlopes(
        runs=tuple(runs),
        shear_modulus=modulus,
        shear_modulus_std=modulus * _std(np.log(solved[:, 1:, 0])),
        magnification=solved[:, 0, 1],
        drawbar_pull=pull[:, 0],
        drawbar_pull_std=_std(pull[:, 1:]),
        required=np.asarray(required),
        reference=reference,
        why=why,
    )


def _drawn(
    at: SteadyRun, stress: MeasuredStress, rng: np.random.Generator
) -> list[tuple[StressProfile, SteadyRun]]:
    """Stress and run as measured, and `DRAWS` times with their errors."""
    runs = [at]
    for normal in rng.standard_normal((DRAWS, 3)):
        moved = {
            name: float(getattr(at, name)) + float(getattr(at, f"{name}_std")) * z
            for name, z in zip(("slip", "weight", "slope"), normal.tolist(), strict=True)
        }
        moved["slip"] = float(np.clip(moved["slip"], -MOST_SLIP, MOST_SLIP))
        runs.append(replace(at, **moved))
    return list(zip(stress.profiles(DRAWS, rng), runs, strict=True))


def _std(drawn: Floats) -> Floats:
    """Standard deviation (runs,) over the draws (runs, draws) with a solution; NaN below two."""
    found = np.isfinite(drawn)
    count = found.sum(axis=1)
    mean = np.where(found, drawn, 0.0).sum(axis=1) / np.maximum(count, 1)
    squares = (np.where(found, drawn - mean[:, None], 0.0) ** 2).sum(axis=1)
    return np.where(count > 1, np.sqrt(squares / np.maximum(count - 1, 1)), np.nan)
