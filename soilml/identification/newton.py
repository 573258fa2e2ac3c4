"""Newton-Raphson for friction angle, shear modulus and a lumped pressure-sinkage modulus."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from soilml.config.case import Case
from soilml.errors import FitError
from soilml.fitting.coordinates import Coordinate, rates_at, values_at
from soilml.fitting.covariance import Whitening
from soilml.fitting.damped_descents import EXACT, descend
from soilml.fitting.least_squares import LeastSquaresProblem
from soilml.fitting.readings import Readings
from soilml.identification.fit import Fit
from soilml.identification.linear import (
    misfit_and_variance,
    not_identified,
    with_fixed_parameter,
)
from soilml.numerics.prior import Prior
from soilml.physics.gears import LinearWheel
from soilml.quantities import column
from soilml.remarks import Remark

LEAST_RATIO = 1e-6  # Least ratio of the singular values of the Jacobian
ASSUMED_NOISE = 0.02  # Noise, as a fraction of the reading, where none is declared


def newton(case: Case, readings: Readings, free: Sequence[Coordinate]) -> Fit:
    r"""Newton's iteration on the closed form of the linear-stress wheel, with cohesion fixed.

    .. math:: \theta \leftarrow \theta - (J^T J)^{-1} J^T r, \quad
        \theta = (\varphi, \ln K, \ln k), \quad k = k_c / b + k_\varphi

    which for three readings is Newton-Raphson, for more Gauss-Newton, damped where a step increases
    the cost. There are no bounds from priors: where the rows do not determine all three unknowns
    the iteration ends at a bound of what any soil has, which is an error.

    Parameters
    ----------
    case
        Model of a rigid wheel, soil and noise; the cohesion of its soil is used as it is.
    readings
        Rows with three readings or more.
    free
        The parameters asked for; others than the three unknowns are reported as not identified.

    Raises
    ------
    FitError
        Fewer than three readings, readings that do not determine the unknowns, or no convergence.

    References
    ----------
    Hutangkabodee, Zweiri, Seneviratne and Althoefer, Int. J. Automation and Computing 3(4), 2006.
    """
    gear = case.model.gear
    law = getattr(gear, "braking", LinearWheel.braking)
    closed = LinearWheel(radius=gear.radius, width=gear.width, braking=law)
    case = replace(case, model=replace(case.model, gear=closed))
    if len(readings) < 3:
        raise FitError(f"{len(readings)} readings: the Newton-Raphson method needs three or more")
    return with_fixed_parameter(case, "cohesion", lambda c: _solve(c, readings, free))


def _solve(case: Case, readings: Readings, free: Sequence[Coordinate]) -> Fit:
    soil = case.soil
    unknowns = [  # with search ranges wider than any soil; kphi includes kc / b
        Coordinate("friction_angle", "rad", Prior(0.02, 1.3), float(soil.friction_angle)),
        Coordinate("shear_modulus", "m", Prior(1e-4, 1.0, log=True), float(soil.shear_modulus)),
        Coordinate("kphi", "N/m^(n+2)", Prior(1e3, 1e9, log=True), float(soil.kphi)),
    ]
    measured, declared = readings.measured, readings.std
    known = not readings.undeclared
    std = np.where(np.isfinite(declared), declared, ASSUMED_NOISE * np.abs(measured) + 1e-9)

    start = np.asarray([f.prior.fraction(f.nominal) for f in unknowns])
    whiten = Whitening.beside(1.0 / std, np.zeros((len(std), 0)))
    found = descend(LeastSquaresProblem(case, unknowns, readings, whiten), start, EXACT)
    u = found.x
    if not np.isfinite(found.prediction).all():
        raise FitError("Newton-Raphson left the range in which the wheel is carried")
    if not found.converged or np.minimum(u, 1.0 - u).min() <= 0.0:
        raise FitError(
            "Newton-Raphson does not converge: the rows do not determine friction angle, shear "
            "modulus and pressure-sinkage modulus together; use --method nonlinear"
        )
    singular = np.linalg.svd(found.jacobian, compute_uv=False)
    if len(singular) < 3 or singular[-1] < LEAST_RATIO * singular[0]:
        raise FitError(
            "the rows are too similar for Newton-Raphson: give three or more at different slips "
            "and loads, or use --method nonlinear"
        )
    misfit, variance = misfit_and_variance(found.residual, len(unknowns), known)
    inverse = np.linalg.pinv(found.jacobian.T @ found.jacobian, rcond=1e-14)
    values, rate = values_at(unknowns, u), rates_at(unknowns, u)
    warnings = not_identified("Newton-Raphson", free, ["cohesion", *(f.path for f in unknowns)])
    if not known:
        text = (
            "noise is not declared: estimated from the residuals; in [noise] of the model file "
            "torque_Nm = '3 %' would declare it"
        )
        warnings.append(Remark("undeclared-noise", text, readings.undeclared))
    return Fit(
        method="newton",
        names=tuple(f.path for f in unknowns),
        units=tuple(f.unit for f in unknowns),
        values=values,
        covariance=variance * inverse * np.outer(rate, rate),
        warnings=tuple(warnings),
        rows_used=readings.row_count,
        misfit=misfit if known else float("nan"),
        channels=tuple(column(name) for name in readings.channels),
    )
