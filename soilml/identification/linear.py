"""Cohesion and friction angle of a rigid wheel by linear least squares, with K held fixed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.errors import FitError
from soilml.fitting.coordinates import Coordinate
from soilml.fitting.levels import is_one_load
from soilml.fitting.readings import Readings
from soilml.identification.fit import Fit
from soilml.physics.effects.base import apply_stage
from soilml.physics.forces import apply_input_effects
from soilml.physics.gears import LinearWheel
from soilml.physics.load_case import LoadCase
from soilml.physics.operating_point import Operating
from soilml.quantities import SHEAR
from soilml.remarks import Remark

ITERATIONS = 50  # Most iterations of the stress at the exit and of the weights
#: Condition number of the normal equations above which the rows do not determine both unknowns.
MOST_CONDITION = 1e16
#: One standard deviation of a uniform prior to either side of its middle, as fractions of it.
SIDES = (0.5 - 12.0**-0.5, 0.5 + 12.0**-0.5)
#: Misfit, residuals of twice the declared noise, above which a closed form does not apply.
MOST_MISFIT = 4.0


def linear(case: Case, readings: Readings, free: Sequence[Coordinate]) -> Fit:
    r"""Linear least squares on the stresses at the angle of maximum stress.

    With the entry angle from sinkage and K fixed, load and torque give sigma_m and tau_m of the
    linear-stress wheel, and

    .. math:: \tau_m / (1 - e^{-j_m / K}) = c + \sigma_m \tan\varphi

    is linear in (c, tan phi). The shear stress tau_0 at the exit, which the reference neglects, is
    included; as it depends on c, the equations are solved by fixed-point iteration. Effects on soil
    and contact take part; the difference between linear and exact stress distributions is not in
    `std`.

    Parameters
    ----------
    case
        Model of a rigid wheel, soil and noise; the shear modulus of its soil is used as it is.
    readings
        Two or more rows with torque, sinkage and driving slip, at different loads or slips.
    free
        The parameters asked for; others than c, phi and K are reported as not identified.

    Raises
    ------
    FitError
        Where torque or sinkage is missing, or the rows do not determine c and phi.

    References
    ----------
    Iagnemma, Kang, Shibly and Dubowsky, IEEE Trans. Robotics 20(5), 2004.
    """
    return with_fixed_parameter(case, "shear_modulus", lambda c: _solve(c, readings, free))


def _solve(case: Case, readings: Readings, free: Sequence[Coordinate]) -> Fit:
    slip, load, *measured = _usable_rows(case, readings)
    declared = bool(np.isfinite(measured[2:]).all())
    if not declared and len(slip) == 2:
        raise FitError("two rows leave no residual to estimate the noise: declare it in [noise]")

    def system(torque: Floats, sinkage: Floats, cohesion: float) -> tuple[Floats, Floats]:
        return _equations(case, slip, load, torque, sinkage, cohesion)

    solution, matrix, right, weight = _iterate(system, *measured, declared=declared)
    residual = (right - matrix @ solution) * weight
    misfit, noise_variance = misfit_and_variance(residual, 2, declared)
    weighted = matrix * weight[:, None]
    normal = weighted.T @ weighted
    if np.linalg.cond(normal) > MOST_CONDITION:
        raise FitError("all rows are equal: the linear method needs different loads or slips")
    covariance = np.asarray(np.linalg.inv(normal) * noise_variance, dtype=np.float64)
    angle = float(np.arctan(solution[1]))
    rate = np.asarray([1.0, np.cos(angle) ** 2])  # of (c, phi) by (c, tan phi)
    return Fit(
        method="linear",
        names=("cohesion", "friction_angle"),
        units=("Pa", "rad"),
        values=np.asarray([solution[0], angle]),
        covariance=covariance * np.outer(rate, rate),
        warnings=tuple(_limits(case, free, solution, load)),
        rows_used=len(slip),
        misfit=misfit if declared else float("nan"),
        channels=("torque_Nm", "sinkage_m"),
    )


def _usable_rows(case: Case, readings: Readings) -> Floats:
    """Slip, load, torque and sinkage under driving slip, noise of these, (6, n).

    Noise is NaN where it is not declared.
    """
    (torque, torque_std), (sinkage, sinkage_std) = (
        _of_rows(readings, name) for name in ("torque", "sinkage")
    )
    slip = readings.row_slip
    usable = np.isfinite(torque) & np.isfinite(sinkage) & (slip >= 0)
    radius = float(getattr(case.model.gear, "radius"))  # noqa: B009 - gears of other kinds lack it
    usable &= (sinkage > 0) & (sinkage < radius)
    if usable.sum() < 2:
        raise FitError(
            f"{int(usable.sum())} rows with driving slip, torque and sinkage: the linear method "
            "needs two at different loads or slips"
        )
    columns = slip, readings.row_load, torque, sinkage, torque_std, sinkage_std
    return np.stack(columns)[:, usable]


def _iterate(
    system: Callable[[Floats, Floats, float], tuple[Floats, Floats]],
    torque: Floats,
    sinkage: Floats,
    torque_std: Floats,
    sinkage_std: Floats,
    *,
    declared: bool,
) -> tuple[Floats, Floats, Floats, Floats]:
    """Solution (2,), matrix (n, 2), right-hand side (n,) and weights (n,) at the fixed point.

    Weights are the inverse standard deviations of the residuals by propagation of the noise.
    """
    weight: Floats = np.ones_like(torque)
    solution: Floats = np.zeros(2)
    for _ in range(ITERATIONS):
        matrix, right = system(torque, sinkage, solution[0])
        before = solution
        found = np.linalg.lstsq(matrix * weight[:, None], right * weight, rcond=None)[0]
        solution = np.asarray(found, dtype=np.float64)
        if declared:
            residual = right - matrix @ solution
            moved = [
                system(torque + torque_std, sinkage, solution[0]),
                system(torque, sinkage + sinkage_std, solution[0]),
            ]
            change = [(b - m @ solution) - residual for m, b in moved]
            weight = 1.0 / np.sqrt(change[0] ** 2 + change[1] ** 2)
        if np.allclose(solution, before, rtol=1e-10, atol=1e-10):
            break
    return solution, matrix, right, weight


def _equations(
    case: Case, slip: Floats, load: Floats, T: Floats, z: Floats, cohesion: float
) -> tuple[Floats, Floats]:
    """Matrix (n, 2) and right-hand side (n,), Pa, of equations linear in (c, tan phi)."""
    gear = LinearWheel(radius=case.model.gear.radius, width=case.model.gear.width)
    effects = case.model.effects
    scene = apply_input_effects(LoadCase(gear, case.soil, Operating(slip=slip, load=load), effects))
    shape = gear.contact_geometry(z, scene.soil, scene.at)
    contact = gear.contact(apply_stage(effects, "on_contact", shape, scene), scene.at)
    mobilised = -np.expm1(-np.abs(contact.shear_displacement) / case.soil.shear_modulus)
    m0, m1 = mobilised  # at exit and at maximum stress
    scale = contact.shear_lever_arm * contact.area[1]
    # torque: lever (area_0 tau_0 + area_1 tau_1), tau_0 = c m0
    tau_m = (T - contact.shear_lever_arm * contact.area[0] * cohesion * m0) / scale
    rest = load - tau_m * contact.frontal_area[1] - cohesion * m0 * contact.frontal_area[0]
    sigma_m = rest / contact.horizontal_area[1]
    from_c = m1 + m0 * contact.area[0] / contact.area[1]
    return np.stack([from_c, m1 * sigma_m], axis=1), T / scale


def _of_rows(readings: Readings, name: str) -> tuple[Floats, Floats]:
    """Readings of a channel by row, (n,), and their noise; NaN where it was not measured."""
    if name not in readings.channels:
        raise FitError(
            f"the linear method needs {name}; declare the noise of torque and sinkage, or of no "
            "channel"
        )
    own = readings.channel == readings.channels.index(name)
    found = np.full((2, len(readings.row_slip)), np.nan)
    found[:, readings.row[own]] = readings.measured[own], readings.std[own]
    return found[0], found[1]


def _limits(case: Case, free: Sequence[Coordinate], solution: Floats, load: Floats) -> list[Remark]:
    """What the closed form leaves out, and values outside what soil can have."""
    remarks = not_identified("linear", free, SHEAR)
    if any(effect.overrides("on_stress") for effect in case.model.effects):
        text = "the linear method neglects effects on the stress"
        remarks.append(Remark("effects-neglected", text))
    if solution[0] < 0 or solution[1] < 0:
        text = "the linear method gives a negative value, which no soil has"
        remarks.append(Remark("negative-value", text))
    if is_one_load(load):
        text = "one load only: cohesion is not identified"
        remarks.append(Remark("not-identified", text, ("cohesion",)))
    return remarks


def misfit_and_variance(residual: Floats, unknowns: int, declared: bool) -> tuple[float, float]:
    """Mean square of whitened residuals per degree of freedom, and the variance of the noise.

    NaN where no degree is left. The variance is that of the residuals where noise is not declared,
    or smaller than they say.
    """
    freedom = len(residual) - unknowns
    if freedom < 1:
        return float("nan"), 1.0
    misfit = float(residual @ residual / freedom)
    return misfit, misfit if not declared or misfit > 1.0 else 1.0


def not_identified(method: str, free: Sequence[Coordinate], known: Sequence[str]) -> list[Remark]:
    """That a closed form identifies no parameters other than those it knows."""
    text = "{} is not identified by the {} method"
    paths = [f.path for f in free if f.path not in known]
    return [Remark("not-identified", text.format(path, method), (path,)) for path in paths]


def with_fixed_parameter(case: Case, path: str, solve: Callable[[Case], Fit]) -> Fit:
    """Solve with the parameter `path` fixed at the case's value, and propagate its prior.

    The covariance grows by the mean square change of the solution when the fixed value is moved one
    standard deviation to either side of the prior's middle. Without a prior the value is taken as
    exact.
    """
    fit = solve(case)
    prior = case.prior.get(path)
    covariance = fit.covariance.copy()
    known = " and treated as exact: it has no prior"
    if prior is not None:
        known = "; the width of its prior is propagated into std"
    text = f"{path} is fixed at {float(case.parameters()[path][1]):g}{known}"
    for side in SIDES if prior is not None else ():
        assert prior is not None
        moved = float(prior.at(np.asarray([side]))[0])
        try:
            change = solve(case.with_values({path: moved})).values - fit.values
        except FitError:
            continue
        covariance += 0.5 * np.outer(change, change)
    note = Remark("fixed-parameter", text, (path,))
    warnings = (note, *fit.warnings, *_validity(fit, case))
    return replace(fit, covariance=covariance, warnings=warnings)


def _validity(fit: Fit, case: Case) -> list[Remark]:
    """Values outside their priors and residuals beyond the noise: the method has no bounds."""
    remarks = []
    for name, value in zip(fit.names, fit.values, strict=True):
        prior = case.prior.get(name)
        if prior is not None and not prior.lower <= value <= prior.upper:
            ends = f"{prior.lower:g} to {prior.upper:g}"
            text = f"{name} is {value:.4g}, outside its prior of {ends}: do not use it"
            remarks.append(Remark("outside-prior", text, (name,)))
    if fit.misfit > MOST_MISFIT:
        text = (
            f"residuals are {np.sqrt(fit.misfit):.1f} times the declared noise: the closed form "
            "does not describe these rows; use --method nonlinear"
        )
        remarks.append(Remark("excess-residuals", text))
    return remarks
