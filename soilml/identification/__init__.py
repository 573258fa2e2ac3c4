"""Identification of soil parameters from measured rows, without training.

Every method has the signature `(case, readings, free) -> Fit`; a new method is one new file and
one line in `METHODS`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from soilml.config.case import Case
from soilml.config.given_case import GivenCase, as_case
from soilml.config.remainder import SAME_ROWS
from soilml.errors import InputError, solvable
from soilml.fitting.coordinates import Coordinate, select_free
from soilml.fitting.fitted_readings import FittedReadings
from soilml.fitting.readings import Readings
from soilml.fitting.usable_readings import usable_readings
from soilml.identification.averaged import averaged
from soilml.identification.fit import Fit, disagreeing_soil_tests
from soilml.identification.linear import linear
from soilml.identification.newton import newton
from soilml.identification.nonlinear import nonlinear
from soilml.identification.posterior import posterior
from soilml.io.read_table import Rows, as_table
from soilml.physics.gears.rigid_wheel import RigidWheel
from soilml.processes import threads_for
from soilml.remarks import Remark

Method = Callable[[Case, Readings, Sequence[Coordinate]], Fit]

#: Identification method by the name that `--method` takes.
METHODS: dict[str, Method] = {
    "averaged": averaged,
    "nonlinear": nonlinear,
    "linear": linear,
    "newton": newton,
    "posterior": posterior,
}
#: Methods that need the closed form of a rigid wheel with linear stresses.
CLOSED_FORM = ("linear", "newton")
TEST_DISAGREES = (
    "the rows disagree with a test of the soil: {}; an effect may be missing from the model, or "
    "the test was made on another soil"
)


@solvable("the identification")
def identify(
    case: GivenCase,
    table: Rows,
    free: Sequence[str] | None = None,
    method: str = "averaged",
) -> Fit:
    """Identify parameters of a case from measured rows.

    Parameters
    ----------
    case
        Model, soil, priors and noise, as `read_case` returns it, or the path of a model file.
    table
        Measured rows: a `Table`, a data frame or the path of a table, with `slip`, `load_N`, and
        one or more of `torque_Nm`, `drawbar_pull_N` and `sinkage_m`; NaN where not measured.
    free
        Paths of the free parameters (`cohesion`, `kphi`, `slip-sinkage.n1`); by default those with
        a prior.
    method
        A key of `METHODS`: `averaged` over explanations of the rows, by their evidence; the others,
        `nonlinear`, `linear`, `newton` and `posterior`, take the model as exact, but for its
        [discrepancy], and sensors to have the errors of [noise] and [bias] alone.

    Returns
    -------
    Fit
        Values, covariance and warnings.

    Raises
    ------
    InputError
        For a method or a parameter that does not exist, or a method that is not for this gear.
    FitError
        Where the rows do not determine a fit; the message states what is missing.
    TableError
        Where the table names another wheel than the case's.

    Examples
    --------
    >>> import numpy as np
    >>> from soilml import Case, Model, Operating, Table, Wheel, identify, soil
    >>> from soilml.config.measurement_noise import Noise
    >>> from soilml.numerics.prior import Prior
    >>> case = Case(
    ...     Model(Wheel(radius=0.15, width=0.12)),
    ...     soil("wong1989/dry_sand"),
    ...     prior={"friction_angle": Prior(0.4, 0.8)},
    ...     noise={"torque_Nm": Noise(share=0.02)},
    ... )
    >>> slip, load = np.asarray([0.1, 0.3, 0.5]), np.full(3, 60.0)
    >>> torque = case.model(case.soil, Operating(slip=slip, load=load)).torque
    >>> rows = Table({"slip": slip, "load_N": load, "torque_Nm": torque})
    >>> fit = identify(case, rows)
    >>> print(f"{fit['friction_angle']:.3f} +- {fit.std[0]:.3f} rad")
    0.500 +- 0.061 rad
    """
    case, table = as_case(case).without_explanations(), as_table(table)
    if method not in METHODS:
        raise InputError(f"no method {method!r}; there are: {', '.join(METHODS)}")
    if method in CLOSED_FORM and case.gears:
        raise InputError(f"the {method} method is for one gear, in [gear]; take nonlinear")
    if method in CLOSED_FORM and not isinstance(case.model.gear, RigidWheel):
        raise InputError(
            f"the {method} method is for rigid wheels, not for a {case.model.gear.name}; take "
            "nonlinear"
        )
    learned, case = case.remainder, case.without_remainder_of(table)
    readings = usable_readings(case, table, drifts=METHODS[method] is averaged).thinned()
    selected = select_free(case, free)
    with threads_for(len(readings)):
        fit = METHODS[method](case, readings, selected)
    if method not in CLOSED_FORM and fit.low is None:
        fit = _within_priors(fit, selected)
    found = dict(zip(fit.names, fit.values, strict=True))
    tests = [] if method in CLOSED_FORM else disagreeing_soil_tests(case, found)
    remarks = [
        *([SAME_ROWS] if case.remainder is not learned else []),
        *_ignored(case, fit, readings),
        *(Remark("soil-test-disagrees", TEST_DISAGREES.format(text)) for text in tests),
        *readings.notes,
    ]
    shown = (
        selected if tuple(c.path for c in selected) == fit.names else select_free(case, fit.names)
    )
    curves = partial(FittedReadings.of, case, readings, shown, fit.values, fit.covariance)
    return replace(fit, warnings=(*fit.warnings, *remarks), curves=curves)


def _within_priors(fit: Fit, selected: Sequence[Coordinate]) -> Fit:
    """A fit whose Gaussian intervals end where the prior ends: no cohesion is below zero."""
    low, high = fit.interval
    prior = {parameter.path: parameter.prior for parameter in selected}
    ends = np.asarray([(prior[name].lower, prior[name].upper) for name in fit.names])
    return replace(fit, low=np.maximum(low, ends[:, 0]), high=np.minimum(high, ends[:, 1]))


def _ignored(case: Case, fit: Fit, readings: Readings) -> list[Remark]:
    """What a closed form leaves out of what the case and the rows declare."""
    if fit.method not in CLOSED_FORM:
        return []
    declared = [key for key, one in case.discrepancy.items() if one.amplitude(1.0) > 0.0]
    ignored = [f"the [discrepancy] of {', '.join(declared)}"] if declared else []
    ignored += ["[bias]"] if case.bias else []
    ignored += ["[[soil.test]]"] if case.soil_tests else []
    noisy = readings.slip_std.any() or readings.load_std.any()
    ignored += ["noise of slip and load"] if noisy else []
    text = f"the {fit.method} method ignores {', '.join(ignored)}: its intervals are too narrow"
    return [Remark("ignored-setting", text)] if ignored else []


__all__ = ["METHODS", "Fit", "identify"]
