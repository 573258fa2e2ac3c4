"""What speaks against agreement of a model and its rows, although no smooth gap was found."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from soilml.config.case import Case
from soilml.fitting.least_squares import Solution
from soilml.fitting.misfit import Misfit, excess_residuals_remark, misfit_limit
from soilml.gap.decision import pressed_priors
from soilml.gap.held_out import FITTED
from soilml.gap.results import GapReduction
from soilml.identification.fit import disagreeing_soil_tests
from soilml.inference import constants
from soilml.inference.posterior import Posterior
from soilml.quantities import column
from soilml.remarks import Remark
from soilml.report.numbers import decimal

#: Mean squared residual of rows kept back that scatter of a few runs seldom leaves: of two runs,
#: once in fifty times.
UNEXPLAINED = 4.0


def disagreements(
    posterior: Posterior,
    case: Case,
    misfit: Misfit | None,
    alone: Solution,
    figures: Mapping[str, GapReduction],
) -> list[Remark]:
    """What disagrees with what; empty where nothing does.

    misfit: Of the soil alone, under the declared noise.
    alone: The soil alone, under noise and scatter.
    figures: Of rows kept back, by the soil alone.
    """
    soil, terms = posterior.soil, posterior.terms
    found = _excess_residuals(posterior, case, misfit, alone)
    at = soil.without.at
    for name, scale in zip(terms.readings.channels, terms.noise_scale(at), strict=True):
        if scale >= constants.NOISE_SCALED_UP:
            size = f"those of {column(name)} {decimal(scale, 2)} times as much"
            text = f"readings scatter more than their declared noise: {size}"
            found.append(Remark("noise-scaled", text, (column(name),)))
    angle, bearing = terms.scatter(at)
    if max(angle, bearing) >= constants.UNUSUAL_RUN_EFFECT:
        degrees = np.degrees(angle * constants.SCATTER_UNITS["friction_angle"])
        share = bearing * constants.SCATTER_UNITS["bearing"]
        text = (
            "runs differ from each other like different soils: their friction angle varies by "
            f"{degrees:.2g} deg, and their bearing strength by {share:.0%}"
        )
        found.append(Remark("runs-differ", text))
    found += [
        Remark(
            "region-not-predicted",
            "rows kept back are not predicted by the others: mean squared residual "
            f"{decimal(g.before, 2)} (1 is expected), {g.description}",
            (name,),
        )
        for name, g in figures.items()
        if name != FITTED and g.before > UNEXPLAINED
    ]
    found += [
        Remark("soil-test", f"the rows disagree with a test of the soil: {text}")
        for text in disagreeing_soil_tests(soil.fit.case, soil.fit.values())
    ]
    return found


def _excess_residuals(
    posterior: Posterior, case: Case, misfit: Misfit | None, alone: Solution
) -> list[Remark]:
    """Residuals beyond the declared noise that scatter does not account for.

    Where the noise that the residuals show, rough in slip, alone accounts for them, the priors are
    not doubted.
    """
    if misfit is None or not misfit.exceeds_noise:
        return []
    readings, terms, at = posterior.terms.readings, posterior.terms, posterior.noise
    left = max(len(readings) - len(posterior.problem.soil), 1)
    granted = alone.cost / max(int((~posterior.outliers).sum()) - len(posterior.problem.soil), 1)
    if terms.scatter(at).any() and granted <= misfit_limit(left):
        return []
    scale = terms.noise_scale(at)[readings.channel]
    noisier = misfit.per_freedom / float(np.mean(scale**2)) <= misfit_limit(left)
    if not noisier and (pressed := pressed_priors(alone)):
        text = (
            f"the soil is at ends of its priors: {'; '.join(pressed.values())}. Widen these priors "
            "in [soil.prior], or the model lacks an effect, or the noise is understated"
        )
        return [Remark("soil-at-prior", text, tuple(pressed))]
    consequence = "no scatter from run to run accounts for them"
    return [excess_residuals_remark(misfit.factor, case, consequence)]
