"""Linear least squares for cohesion and friction angle, from measured sinkage."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.errors import FitError
from soilml.identification.fit_result import Fit
from soilml.identification.fixed_parameter import with_fixed_parameters
from soilml.identification.free_parameters import FreeParameter
from soilml.identification.observations import Channel, Observations
from soilml.physics.effects.base import apply_stage
from soilml.physics.forces import apply_input_effects
from soilml.physics.gears import LinearWheel
from soilml.physics.load_case import LoadCase
from soilml.physics.operating_point import Operating

Floats = NDArray[np.float64]
ROUNDS = 50


def linear(case: Case, data: Observations, free: Sequence[FreeParameter]) -> Fit:
    r"""Straight line through the stresses at the angle of maximum stress.

    With the entry angle from sinkage and K given, load and torque give sigma_m and tau_m of the
    linear-stress wheel, and

    .. math:: \tau_m / (1 - e^{-j_m / K}) = c + \sigma_m \tan\varphi

    is linear in (c, tan phi); so is the stress tau_0 at the exit, which is kept. sigma_m depends
    on c a little: it is updated until it stands. References: Iagnemma, Kang, Shibly and Dubowsky,
    IEEE Trans. Robotics 20(5), 2004. Needs torque and sinkage in every row, driving slip, and two
    rows at different loads or slips. Effects on soil and contact take part; the difference between
    straight lines and the full stresses is not in its std.
    """
    return with_fixed_parameters(case, "shear_modulus", lambda c: _solved(c, data, free))


def _solved(case: Case, data: Observations, free: Sequence[FreeParameter]) -> Fit:
    torque, sinkage = _channel(data, "torque"), _channel(data, "sinkage")
    usable = np.isfinite(torque.reading) & np.isfinite(sinkage.reading) & (data.slip >= 0)
    radius = float(getattr(case.model.gear, "radius"))  # noqa: B009 - gears of other kinds lack it
    usable &= (sinkage.reading > 0) & (sinkage.reading < radius)
    if usable.sum() < 2:
        raise FitError(
            f"{int(usable.sum())} rows with driving slip, torque and sinkage: the linear method "
            "needs two at different loads or slips"
        )
    T, z = torque.reading[usable], sinkage.reading[usable]
    slip, load = data.slip[usable], data.load[usable]
    noise_T, noise_z = torque.std[usable], sinkage.std[usable]
    known = bool(np.isfinite(noise_T).all() and np.isfinite(noise_z).all())

    def rows(torques: Floats, depths: Floats, cohesion: float) -> tuple[Floats, Floats]:
        return _line(case, slip, load, torques, depths, cohesion)

    weight: Floats = np.ones_like(T)
    solution: Floats = np.zeros(2)
    for _ in range(ROUNDS):
        matrix, right = rows(T, z, solution[0])
        before = solution
        solution = np.asarray(
            np.linalg.lstsq(matrix * weight[:, None], right * weight, rcond=None)[0],
            dtype=np.float64,
        )
        if known:
            strayed = [
                rows(T + noise_T, z, solution[0]),
                rows(T, z + noise_z, solution[0]),
            ]
            off = [(b - m @ solution) - (right - matrix @ solution) for m, b in strayed]
            weight = 1.0 / np.sqrt(off[0] ** 2 + off[1] ** 2)
        if np.allclose(solution, before, rtol=1e-10, atol=1e-10):
            break
    residual = (right - matrix @ solution) * weight
    freedom = len(T) - 2
    misfit = float(residual @ residual / freedom) if freedom > 0 else float("nan")
    if not known and freedom == 0:
        raise FitError("two rows leave no residual to tell the noise: declare it in [noise]")
    scale = misfit if freedom > 0 and (not known or misfit > 1.0) else 1.0
    normal = (matrix * weight[:, None]).T @ (matrix * weight[:, None])
    if np.linalg.cond(normal) > 1e16:
        raise FitError("all rows are alike: the linear method needs different loads or slips")
    covariance = np.asarray(np.linalg.inv(normal) * scale, dtype=np.float64)
    angle = float(np.arctan(solution[1]))
    rate = np.asarray([1.0, np.cos(angle) ** 2])
    return Fit(
        method="linear",
        names=("cohesion", "friction_angle"),
        units=("Pa", "rad"),
        values=np.asarray([solution[0], angle]),
        covariance=covariance * np.outer(rate, rate),
        warnings=tuple(_said(case, free, solution, load)),
        rows_used=len(T),
        misfit=misfit if known else float("nan"),
        channels=("torque_Nm", "sinkage_m"),
    )


def _line(
    case: Case, slip: Floats, load: Floats, T: Floats, z: Floats, cohesion: float
) -> tuple[Floats, Floats]:
    """Rows of the system matrix (n, 2) @ (c, tan phi) = right-hand side (n,), all in Pa."""
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


def _channel(data: Observations, name: str) -> Channel:
    for channel in data.channels:
        if channel.name == name:
            return channel
    raise FitError(f"the linear method needs {name} in every row, with its noise declared or none")


def _said(case: Case, free: Sequence[FreeParameter], solution: Floats, load: Floats) -> list[str]:
    said = [
        f"{f.path} is not identified by the linear method"
        for f in free
        if f.path not in ("cohesion", "friction_angle", "shear_modulus")
    ]
    if any(effect.overrides("on_stress") for effect in case.model.effects):
        said.append("the linear method leaves out effects on the stress")
    if solution[0] < 0 or solution[1] < 0:
        said.append("the straight line gives a negative value: outside what soil can be")
    if np.ptp(load) <= 0.02 * np.mean(load):
        said.append("one load only: cohesion is not identified")
    return said
