"""Shear modulus of each run of a wheel with measured stress, and the pull that one predicts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats
from soilml.errors import FitError, InputError, TableError
from soilml.io.table import Table
from soilml.systems.force_sensor_wheel.deconvolution import deconvolve
from soilml.systems.force_sensor_wheel.force_balance import (
    MohrCoulomb,
    SteadyRun,
    solve_force_balance,
    solve_vertical_balance,
)
from soilml.systems.force_sensor_wheel.sensor_readings import BinnedStress, SensingWheel
from soilml.systems.force_sensor_wheel.shear_modulus import delta_method_covariance
from soilml.systems.force_sensor_wheel.stress_profile import StressProfile


@dataclass(frozen=True)
class RunsOnSlopes:
    """What the force balance of each run gives, all arrays (runs,); NaN where it has no solution.

    shear_modulus, shear_modulus_std: k_x, m, and its standard deviation by the declared errors.
    magnification: True over measured stress, M.
    drawbar_pull: Predicted by the k_x of the reference run, N.
    required: Pull that the slope requires, N.
    reference: The run whose k_x predicts.
    why: Reasons by run without a solution.
    """

    runs: tuple[str, ...]
    shear_modulus: Floats
    shear_modulus_std: Floats
    magnification: Floats
    drawbar_pull: Floats
    required: Floats
    reference: str
    why: Mapping[str, str]


def read_profiles(stresses: Table, discs: SensingWheel | None = None) -> dict[str, StressProfile]:
    """The stress of each run from rows of `run`, `angle_rad`, `normal_Pa`, in any order.

    `discs` is the wheel whose round sensors averaged the stress; the averaging is then removed.
    Raises `TableError` for a run whose rows are no profile, or too few for that.
    """
    found: dict[str, StressProfile] = {}
    for name, rows in stresses.groups():
        order = np.argsort(rows["angle_rad"], kind="stable")
        try:
            profile = StressProfile(rows["angle_rad"][order], rows["normal_Pa"][order])
            found[name] = profile if discs is None else deconvolve(_as_bins(profile, discs), discs)
        except (FitError, InputError) as error:
            raise TableError(f"{stresses.source}: run {name}: {error}") from None
    return found


def _as_bins(profile: StressProfile, wheel: SensingWheel) -> BinnedStress:
    """Means over discs; of one below twice the deadband, some samples may have read nothing."""
    inside = profile.normal * wheel.area > 2.0 * float(wheel.deadband)
    return BinnedStress(profile.angle, profile.normal, inside, saturated_fraction=0.0)


def solve_runs(
    runs: Mapping[str, SteadyRun],
    profiles: Mapping[str, StressProfile],
    wheel: SensingWheel,
    strength: MohrCoulomb,
    reference: str | None = None,
) -> RunsOnSlopes:
    """Solve the balance of each run for k_x, and predict all pulls with that of one run.

    One k_x serves up to a slip of about 0.5. The standard deviation is of the declared errors of
    slip, weight and slope alone.

    Parameters
    ----------
    runs
        Slip, weight and slope of each run.
    profiles
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
    if missing := [name for name in runs if name not in profiles]:
        raise InputError(
            f"run {missing[0]} has no stress: give its rows of angle_rad and normal_Pa"
        )
    if reference is None:
        reference = min(runs, key=lambda name: abs(float(runs[name].slope)))
    if reference not in runs:
        raise InputError(f"no run {reference!r}; there are: {', '.join(runs)}")
    solved, why = np.full((3, len(runs)), np.nan), dict[str, str]()
    for k, (name, at) in enumerate(runs.items()):
        profile = profiles[name]

        def modulus(moved: SteadyRun, profile: StressProfile = profile) -> Floats:
            found = solve_force_balance(profile, moved, wheel, strength)
            return np.asarray([found.shear_modulus, found.magnification])

        try:
            solved[:2, k] = modulus(at)
            solved[2, k] = np.sqrt(delta_method_covariance(at, modulus)[0, 0])
        except FitError as error:
            why[name] = str(error)
    if reference in why:
        raise FitError(f"run {reference}, the reference: {why[reference]}")
    known = solved[:1, list(runs).index(reference)]
    pulls = [
        float(solve_vertical_balance(profiles[name], at, wheel, strength, known)[1][0])
        for name, at in runs.items()
    ]
    required = [float(at.weight) * np.sin(float(at.slope)) for at in runs.values()]
    return RunsOnSlopes(
        runs=tuple(runs),
        shear_modulus=solved[0],
        shear_modulus_std=solved[2],
        magnification=solved[1],
        drawbar_pull=np.asarray(pulls),
        required=np.asarray(required),
        reference=reference,
        why=why,
    )
