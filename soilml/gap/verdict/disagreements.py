"""Measurements that disagree with each other: reasons against a verdict without a gap."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from soilml.fitting.least_squares import Solution
from soilml.fitting.predictions import linearise
from soilml.fitting.readings import Readings
from soilml.gap.evidence.held_out import held_out_region
from soilml.gap.evidence.repeats import chi_square_tail, repeat_disagreement
from soilml.identification.fit import disagreeing_soil_tests
from soilml.inference.conditional import conditional
from soilml.inference.constants import SCATTER_UNITS
from soilml.inference.explanation import Explanation
from soilml.inference.gaussian_terms import scatter_columns, terms_like
from soilml.inference.posterior import Posterior
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


def disagreements(posterior: Posterior) -> list[Remark]:
    """What disagrees with what although no smooth gap was found; empty where nothing does."""
    soil, terms = posterior.soil, posterior.terms
    readings, at = terms.readings, soil.without.at
    found = repeats_that_disagree(posterior, soil.fit)
    for name, scale in zip(readings.channels, terms.noise_scale(at), strict=True):
        if scale >= NOISE_SCALED_UP:
            text = (
                f"readings of {column(name)} scatter {decimal(scale, 2)} times as much as their "
                "declared noise"
            )
            found.append(Remark("noise-scaled", text, (column(name),)))
    angle, bearing = terms.scatter(at)
    if max(angle, bearing) >= UNUSUAL_RUN_EFFECT:
        degrees = np.degrees(angle * SCATTER_UNITS["friction_angle"])
        text = (
            "runs differ from each other like soils whose friction angle varies by "
            f"{degrees:.2g} deg and whose bearing strength "
            f"varies by {bearing * SCATTER_UNITS['bearing']:.0%}"
        )
        found.append(Remark("runs-differ", text))
    chosen = held_out_region(readings)
    if chosen is not None:
        found += unpredicted_region(posterior, soil, *chosen)
    found += [
        Remark("soil-test", f"the rows disagree with a test of the soil: {text}")
        for text in disagreeing_soil_tests(soil.fit.case, soil.fit.values())
    ]
    return found


def repeats_that_disagree(posterior: Posterior, fit: Solution) -> list[Remark]:
    """Replicate rows that differ by more than declared noise and usual scatter explain.

    The predictions of `fit` account for their small differences in slip and load.
    """
    readings, rho = posterior.terms.readings, posterior.noise.autocorrelation
    columns = scatter_columns(fit.fitted(), readings) * float(len(readings.runs) > 1)
    run, order = readings.run[readings.row], readings.order[readings.row]
    same = (run[:, None] == run).astype(np.float64)
    series = same * (readings.channel[:, None] == readings.channel)
    lag = np.abs(np.subtract.outer(order, order))
    sentences: dict[str, str] = {}
    agree: set[str] = set()
    # an estimated correlation of neighbouring samples can hide or make a disagreement: rows
    # disagree only if they do with it and without it
    for correlation in sorted({0.0, rho}):
        noise = series * correlation**lag if correlation else np.eye(len(readings))
        covariance = np.outer(readings.std, readings.std) * noise + same * (columns @ columns.T)
        for comparison in repeat_disagreement(readings, covariance, fit.prediction):
            sentences.setdefault(comparison.channel, comparison.sentence)
            if comparison.p_value >= REPEAT_LEVEL:
                agree.add(comparison.channel)
    return [
        Remark("repeats-disagree", text, (column(channel),))
        for channel, text in sentences.items()
        if channel not in agree
    ]


def unpredicted_region(
    posterior: Posterior, soil: Explanation, name: str, out: NDArray[np.bool_]
) -> list[Remark]:
    """The region that a fit to the other rows fails to predict, uncertainty of the fit included."""
    at = soil.without.at
    found = conditional(soil.linear.without(soil.outliers | out), at)
    own = out & ~soil.outliers
    matrix = found.joint(own)
    residual = soil.linear.residual[own] - found.expected[own]
    square = float(residual @ np.linalg.solve(matrix, residual))
    if chi_square_tail(square, residual.size) >= REGION_LEVEL:
        return []
    text = (
        f"the region {name} is not predicted by a fit to the other rows: mean squared residual "
        f"{decimal(square / residual.size, 2)} (1 is expected)"
    )
    return [Remark("region-not-predicted", text)]


def unpredicted_rows(posterior: Posterior, readings: Readings, description: str) -> list[Remark]:
    """Rows that took no part, where the soil alone fails to predict them.

    Uncertainty of the fit is included, and noise and scatter of the rows themselves.
    """
    fit, at = posterior.soil.fit, posterior.soil.without.at
    found = linearise(fit.case, fit.coordinates, fit.x, readings)
    readings = readings.with_noise_at(found.prediction)
    answered = np.isfinite(found.prediction) & np.isfinite(found.jacobian).all(axis=1)
    if not answered.any():
        return []
    columns = scatter_columns(fit.fitted(), readings)
    terms, own = terms_like(posterior.terms, at, readings, columns)
    jacobian, scatter = found.jacobian[answered], terms.columns[answered]
    covariance = posterior.soil.linear.evaluate(at).covariance
    matrix = np.diag(terms.noise_std(own)[answered] ** 2) + jacobian @ covariance @ jacobian.T
    matrix += (scatter * terms.variance(own)) @ scatter.T
    residual = (readings.measured - found.prediction)[answered]
    square = float(residual @ np.linalg.solve(matrix, residual))
    if chi_square_tail(square, residual.size) >= REGION_LEVEL:
        return []
    text = (
        f"{description}: these rows are not predicted by a fit to the other rows: mean squared "
        f"residual {decimal(square / residual.size, 2)} (1 is expected)"
    )
    return [Remark("region-not-predicted", text)]
