"""What speaks against agreement of a model and its rows: misfit, priors, rows that disagree."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.fitting.least_squares import Solution
from soilml.fitting.misfit import (
    declared_misfit,
    excess_residuals,
    excess_residuals_remark,
    misfit_limit,
)
from soilml.fitting.predictions import linearise
from soilml.fitting.readings import Readings
from soilml.gap.held_out import held_out_region
from soilml.gap.results import NoiseAgreement
from soilml.gap.scores import chi_square_tail
from soilml.identification.fit import disagreeing_soil_tests
from soilml.inference.conditional import conditional
from soilml.inference.constants import PRESSED, SCATTER_UNITS
from soilml.inference.gaussian_terms import scatter_columns, terms_like
from soilml.inference.posterior import Posterior
from soilml.quantities import column
from soilml.remarks import Remark
from soilml.report.numbers import decimal, format_quantity

#: Code of the reason that the soil alone explains the rows where its priors are opened.
OUTSIDE_PRIORS = "soil-outside-priors"
#: Estimated over declared noise from which the noise counts as scaled up. Its standard error is
#: about 10 % with the usual fifty degrees of freedom of a channel.
NOISE_SCALED_UP = 1.3
#: Run-to-run standard deviation, in usual ones, above which runs disagree with each other.
UNUSUAL_RUN_EFFECT = 3.0
REGION_LEVEL = 0.001  # Significance level of the test of rows that a fit to the others predicts


def noise_agreement(
    case: Case, readings: Readings, posterior: Posterior, alone: Solution
) -> NoiseAgreement | None:
    """The misfit under the declared noise, and under noise and scatter, of the same readings.

    None where no fit is possible.

    readings: All readings as declared; those that stray count in neither.
    alone: The soil alone under noise and scatter.
    """
    kept, soil = ~posterior.outliers, posterior.problem.soil
    found = declared_misfit(case, readings.subset(kept), soil, alone.x)
    if found is None:
        return None
    units = SCATTER_UNITS["friction_angle"], SCATTER_UNITS["bearing"]
    angle, bearing = posterior.terms.scatter(posterior.noise) * units
    left = max(int(kept.sum()) - len(soil), 1)
    return NoiseAgreement(
        declared=found.per_freedom,
        exceeds_noise=found.exceeds_noise,
        granted=alone.cost / left,
        friction_angle_std=float(angle),
        bearing_std=float(bearing),
        with_discrepancy=bool(case.discrepancy),
    )


def misfit_remarks(
    found: NoiseAgreement | None, case: Case, posterior: Posterior, alone: Solution
) -> list[Remark]:
    """Residuals beyond the declared noise that scatter does not account for.

    Where the noise that the residuals show, rough in slip, alone accounts for them, the priors are
    not doubted.
    """
    if found is None or not found.exceeds_noise:
        return []
    readings = posterior.terms.readings
    left = max(len(readings) - len(posterior.problem.soil), 1)
    if found.grants_scatter and found.granted <= misfit_limit(left):
        return []
    factor = float(np.sqrt(found.declared))
    scale = posterior.terms.noise_scale(posterior.noise)[readings.channel]
    noisier = found.declared / float(np.mean(scale**2)) <= misfit_limit(left)
    if not noisier and (pressed := pressed_priors(alone)):
        text = (
            f"{excess_residuals(factor, bool(case.discrepancy))} with "
            f"{'; '.join(pressed.values())}: widen these priors in [soil.prior], or the model "
            "lacks an effect, or the noise is understated"
        )
        return [Remark("soil-at-prior", text, tuple(pressed))]
    consequence = "no scatter from run to run accounts for them"
    return [excess_residuals_remark(factor, case, consequence)]


def pressed_priors(fit: Solution) -> dict[str, str]:
    """The soil parameters that a fit has at an end of their prior, by path, in words."""
    found = {}
    for c, x in zip(fit.coordinates, fit.x, strict=True):
        if not c.effect and min(x - c.lower, c.upper - x) < PRESSED:
            end, bound = ("lower", c.prior.lower) if x < 0.5 else ("upper", c.prior.upper)
            value = format_quantity(bound, c.unit)
            found[c.path] = f"{c.name.replace('_', ' ')} at {value}, the {end} end of its prior"
    return found


def opened_priors(posterior: Posterior) -> tuple[Remark, ...]:
    """That the likeliest explanation lies outside the priors of the soil, which forbids a name."""
    best = posterior.best
    if not best.hypothesis.wide_priors:
        return ()
    pressed = pressed_priors(posterior.soil.fit)
    why = "Within them, a large remainder is left"
    if pressed:
        why = f"The fit reached {'; '.join(pressed.values())}"
    text = f"the priors of the soil were opened. {why}"
    if best.hypothesis.effects:
        return (Remark("prior-opened", text, tuple(pressed)),)
    text += ". The soil alone then agrees with the rows"
    return (Remark(OUTSIDE_PRIORS, text, tuple(pressed)),)


def disagreements(posterior: Posterior) -> list[Remark]:
    """What disagrees with what although no smooth gap was found; empty where nothing does."""
    soil, terms = posterior.soil, posterior.terms
    readings, at = terms.readings, soil.without.at
    found = list[Remark]()
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
        found += _unpredicted_region(posterior, *chosen)
    found += [
        Remark("soil-test", f"the rows disagree with a test of the soil: {text}")
        for text in disagreeing_soil_tests(soil.fit.case, soil.fit.values())
    ]
    return found


def _unpredicted_region(posterior: Posterior, name: str, out: NDArray[np.bool_]) -> list[Remark]:
    """The region that a fit to the other rows fails to predict, uncertainty of the fit included."""
    soil = posterior.soil
    found = conditional(soil.linear.without(soil.outliers | out), soil.without.at)
    own = out & ~soil.outliers
    residual = soil.linear.residual[own] - found.expected[own]
    begin = f"the region {name} is not predicted by a fit to the other rows"
    return _if_unlikely(begin, residual, found.joint(own))


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
    begin = f"{description}: these rows are not predicted by a fit to the other rows"
    return _if_unlikely(begin, residual, matrix)


def _if_unlikely(begin: str, residual: Floats, covariance: Floats) -> list[Remark]:
    """A remark where residuals (k,) are too large for their covariance (k, k)."""
    square = float(residual @ np.linalg.solve(covariance, residual))
    if chi_square_tail(square, residual.size) >= REGION_LEVEL:
        return []
    size = decimal(square / residual.size, 2)
    text = f"{begin}: mean squared residual {size} (1 is expected)"
    return [Remark("region-not-predicted", text)]
