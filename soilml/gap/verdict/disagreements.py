"""Measurements that disagree with each other: reasons against a verdict without a gap."""

from __future__ import annotations

import numpy as np

from soilml.errors import InputError
from soilml.fitting.damped_descents import levenberg_marquardt
from soilml.fitting.least_squares import LeastSquaresProblem, Solution
from soilml.fitting.predictions import linearise
from soilml.gap.evidence.covariance import (
    RUN_EFFECT_UNITS,
    VarianceComponents,
    assemble_covariance,
    run_effect_columns,
)
from soilml.gap.evidence.held_out import held_out_region
from soilml.gap.evidence.problem import FitProblem
from soilml.gap.evidence.repeats import repeat_disagreement
from soilml.identification.fit import disagreeing_soil_tests
from soilml.quantities import column
from soilml.remarks import Remark
from soilml.report.numbers import decimal

#: Estimated over declared noise from which the noise counts as scaled up. Its standard error is
#: about 10 % with the usual fifty degrees of freedom of a channel.
NOISE_SCALED_UP = 1.3
#: Run-to-run standard deviation, in usual ones, above which runs disagree with each other.
UNUSUAL_RUN_EFFECT = 3.0
REGION_LEVEL = 0.001  # Significance level of the test of the region that a fit to the rest predicts
REPEAT_LEVEL = 0.001  # Significance level of the test of replicate rows


def disagreements(problem: FitProblem, soil: Solution) -> list[Remark]:
    """What disagrees with what although no smooth gap was found; empty where nothing does."""
    components, readings = problem.covariance.components, problem.readings
    found = repeats_that_disagree(problem, soil)
    for name, scale in zip(readings.channels, components.noise_scale, strict=True):
        if scale >= NOISE_SCALED_UP:
            text = (
                f"readings of {column(name)} scatter {decimal(scale, 2)} times as much as their "
                "declared noise"
            )
            found.append(Remark("noise-scaled", text, (column(name),)))
    angle = components.friction_angle_std / RUN_EFFECT_UNITS["friction_angle"]
    bearing = components.bearing_std / RUN_EFFECT_UNITS["bearing"]
    if max(angle, bearing) >= UNUSUAL_RUN_EFFECT:
        text = (
            "runs differ from each other like soils whose friction angle varies by "
            f"{np.degrees(components.friction_angle_std):.2g} deg and whose bearing strength "
            f"varies by {components.bearing_std:.0%}"
        )
        found.append(Remark("runs-differ", text))
    found += _region(problem, soil)
    found += [
        Remark("soil-test", f"the rows disagree with a test of the soil: {text}")
        for text in disagreeing_soil_tests(soil.case, soil.values())
    ]
    return found


def repeats_that_disagree(problem: FitProblem, fit: Solution) -> list[Remark]:
    """Replicate rows that differ by more than declared noise and usual scatter explain.

    The predictions of `fit` account for their small differences in slip and load.
    """
    readings, found = problem.readings, problem.covariance.components
    several = len(readings.runs) > 1
    columns = run_effect_columns(fit.fitted(), readings)
    sentences: dict[str, str] = {}
    agree: set[str] = set()
    # an estimated correlation of neighbouring samples can hide or make a disagreement: rows
    # disagree only if they do with it and without it
    for autocorrelation in sorted({0.0, found.autocorrelation}):
        usual = VarianceComponents.usual(
            readings, units=float(several), autocorrelation=autocorrelation
        )
        covariance = assemble_covariance(readings, columns, usual).matrix
        for comparison in repeat_disagreement(readings, covariance, fit.prediction):
            sentences.setdefault(comparison.channel, comparison.sentence)
            if comparison.p_value >= REPEAT_LEVEL:
                agree.add(comparison.channel)
    return [
        Remark("repeats-disagree", text, (column(channel),))
        for channel, text in sentences.items()
        if channel not in agree
    ]


def _region(problem: FitProblem, soil: Solution) -> list[Remark]:
    """The region that a fit to the other rows fails to predict, uncertainty of the fit included."""
    from scipy.special import chdtrc

    chosen = held_out_region(problem.readings)
    if chosen is None:
        return []
    name, out = chosen
    covariance = problem.discrepancy.matrix(problem.declared_amplitude)
    rest, inside = ~out, np.ix_(out, out)
    whiten = np.linalg.inv(np.linalg.cholesky(covariance[np.ix_(rest, rest)]))
    try:
        part = problem.readings.subset(rest)
        to_fit = LeastSquaresProblem(soil.case, soil.coordinates, part, whiten)
        fit = levenberg_marquardt(to_fit, soil.x)
        found = linearise(fit.case, fit.coordinates, fit.x, problem.readings)
    except InputError:
        text = f"the region {name} cannot be predicted: no fit to the other rows carries its loads"
        return [Remark("region-not-predicted", text)]
    jacobian = found.jacobian[out]
    residual = (problem.readings.measured - found.prediction)[out]
    if not (np.isfinite(jacobian).all() and np.isfinite(residual).all()):
        text = f"a fit to the rows outside {name} has no equilibrium inside it"
        return [Remark("region-not-predicted", text)]
    matrix = covariance[inside] + jacobian @ fit.covariance @ jacobian.T
    square = float(residual @ np.linalg.solve(matrix, residual))
    if chdtrc(residual.size, square) >= REGION_LEVEL:
        return []
    text = (
        f"the region {name} is not predicted by a fit to the other rows: mean squared residual "
        f"{decimal(square / residual.size, 2)} (1 is expected)"
    )
    return [Remark("region-not-predicted", text)]
