"""Newton-Raphson for friction angle, shear modulus and a lumped pressure-sinkage modulus."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.errors import FitError
from soilml.identification.fit_result import Fit
from soilml.identification.fixed_parameter import with_fixed_parameters
from soilml.identification.free_parameters import FreeParameter
from soilml.identification.observations import Observations
from soilml.identification.predictions import linearised, readings
from soilml.numerics.prior import Prior
from soilml.physics.gears import LinearWheel
from soilml.quantities import column

Floats = NDArray[np.float64]
STEPS = 60
#: Least ratio of the sensitivities to the three unknowns.
LEAST_RANK = 1e-6


def newton(case: Case, data: Observations, free: Sequence[FreeParameter]) -> Fit:
    r"""Newton's iteration on the closed form, cohesion given, three rows or more.

    .. math:: \theta \leftarrow \theta - (J^T J)^{-1} J^T r, \quad
        \theta = (\varphi, \ln K, \ln k), \quad k = k_c / b + k_\varphi

    which for three readings is Newton-Raphson, for more its least-squares form; a step that makes
    things worse is halved. References: Hutangkabodee, Zweiri, Seneviratne and Althoefer, Int. J.
    Automation and Computing 3(4), 2006. It knows no bounds: where the rows do not determine all
    three, it runs away, which is reported as an error.
    """
    gear = case.model.gear
    closed = LinearWheel(radius=gear.radius, width=gear.width)
    case = replace(case, model=replace(case.model, gear=closed))
    if data.cells < 3:
        raise FitError(f"{data.cells} readings: the Newton-Raphson method needs three or more")
    return with_fixed_parameters(case, "cohesion", lambda c: _solved(c, data, free))


def _solved(case: Case, data: Observations, free: Sequence[FreeParameter]) -> Fit:
    soil = case.soil
    unknown = [
        FreeParameter("friction_angle", "rad", Prior(0.02, 1.3), float(soil.friction_angle), False),
        FreeParameter(
            "shear_modulus", "m", Prior(1e-4, 1.0, log=True), float(soil.shear_modulus), False
        ),
        FreeParameter("kphi", "N/m^(n+2)", Prior(1e3, 1e9, log=True), float(soil.kphi), False),
    ]
    reading, std = readings(data)
    known = bool(np.isfinite(std).all())
    std = np.where(np.isfinite(std), std, 0.02 * np.abs(reading) + 1e-9)

    def around(u: Floats) -> tuple[Floats, Floats]:
        y, slope = linearised(case, data, unknown, u)
        return (y - reading) / std, slope / std[:, None]

    u = np.asarray([f.prior.fraction(f.nominal) for f in unknown])
    r, slope = around(u)
    for _ in range(STEPS):
        if not (np.isfinite(r).all() and np.isfinite(slope).all()):
            raise FitError("Newton-Raphson left the range in which the wheel is carried")
        step = np.linalg.lstsq(slope, -r, rcond=1e-14)[0]
        for halving in range(12):
            trial = u + step * 0.5**halving
            if not np.all((trial > 0) & (trial < 1)):
                continue
            new, steeper = around(trial)
            if new @ new <= r @ r:
                u, r, slope = trial, new, steeper
                break
        else:
            if np.abs(step).max() > 1e-6:
                raise FitError(
                    "Newton-Raphson does not converge: the rows do not determine friction angle, "
                    "shear modulus and pressure-sinkage modulus together; use --method nonlinear"
                )
            break
        if np.abs(step).max() < 1e-9:
            break
    size = np.linalg.svd(slope, compute_uv=False)
    if len(size) < 3 or size[-1] < LEAST_RANK * size[0]:
        raise FitError(
            "the rows are too alike for Newton-Raphson: give three or more at different slips and "
            "loads, or use --method nonlinear"
        )
    freedom = len(r) - 3
    misfit = float(r @ r / freedom) if freedom > 0 else float("nan")
    scale = misfit if freedom > 0 and (not known or misfit > 1.0) else 1.0
    covariance = np.asarray(np.linalg.pinv(slope.T @ slope, rcond=1e-14) * scale, dtype=np.float64)
    rate = np.asarray([float(f.prior.rate(u[i : i + 1])[0]) for i, f in enumerate(unknown)])
    said = [
        f"{f.path} is not identified by the Newton-Raphson method"
        for f in free
        if f.path not in ("cohesion", "friction_angle", "shear_modulus", "kphi")
    ]
    if not known:
        said.append("noise is not declared: estimated from the residuals")
    return Fit(
        method="newton",
        names=tuple(f.path for f in unknown),
        units=tuple(f.unit for f in unknown),
        values=np.asarray([float(f.prior.at(u[i : i + 1])[0]) for i, f in enumerate(unknown)]),
        covariance=covariance * np.outer(rate, rate),
        warnings=tuple(said),
        rows_used=len(data.slip),
        misfit=misfit if known else float("nan"),
        channels=tuple(column(c.name) for c in data.channels),
    )
