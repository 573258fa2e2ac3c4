"""Sizes of a hybrid model's errors that a campaign supports, for the file that is trained on it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.errors import FitError, InputError
from soilml.fitting.coordinates import Coordinate, select_free
from soilml.fitting.misfit import misfit_limit
from soilml.fitting.readings import Readings
from soilml.fitting.shared_errors import USUAL_MODEL_ERRORS, usual_errors
from soilml.fitting.usable_readings import usable_readings
from soilml.identification.averaged import ERRORS, EXACT, with_noise_of_fit
from soilml.identification.condensing import condensed
from soilml.identification.hypotheses import ErrorHypothesis, fit_hypothesis
from soilml.io.table import Table
from soilml.onboard.set_contract import MODEL_ERROR_COLUMNS
from training.set_posterior.error_scales import USUAL_SCALES, ErrorScale, ErrorScales

#: A model that is all but right: errors of bearing, contact and channels are a seventh of the usual
#: ones. Those of the laws are what they are in most models, because readings on one soil do not
#: tell them from another soil. Its probability before any row is that which `identify` gives errors
#: of that size and less.
CHECKED = ErrorScale(EXACT + ERRORS[0.1], bearing=0.15, channels=0.15, laws=0.6)

#: Share of the prior that no campaign rules out: errors on other soils than its own.
OPEN = 0.05


@dataclass(frozen=True)
class BoardErrors(ErrorHypothesis):
    """Errors as a file for the board has them: usual ones of sensors, scaled ones of the model.

    `factors` are those of the errors of the model, by name.
    """

    factors: Mapping[str, float] = field(default_factory=dict)

    @staticmethod
    def of(scale: ErrorScale) -> BoardErrors:
        """The errors of a scale; those of laws act as another soil does."""
        factors = dict(zip(MODEL_ERROR_COLUMNS, scale.of_columns.tolist(), strict=True))
        return BoardErrors(scale.probability, factors=factors)

    def errors_of(
        self, case: Case, readings: Readings, free: Sequence[Coordinate]
    ) -> dict[str, float]:
        """Standard deviations of the errors that all rows share."""
        usual = usual_errors(case, readings.row_load, [c.path for c in free])
        return {
            name: std * (self.factors[name] if name in USUAL_MODEL_ERRORS else 1.0)
            for name, std in usual.items()
        }


def supported_scales(case: Case, kept_back: Table, whole: Table) -> ErrorScales:
    r"""Probabilities of sizes of the errors of a hybrid model, given the rows of a campaign.

    .. math:: p(s | y) \propto p(s) \int p(y | \theta, s)\, p(\theta)\, d\theta

    The rows of the runs that were kept back, by which the model was not chosen, say how large its
    errors may be; all rows of the campaign do so too. Those count that leave less to `CHECKED`. A
    share of the prior, `OPEN`, remains in any case. Errors that leave a significant misfit are not
    supported; where all do, the usual ones have their usual probabilities.

    Parameters
    ----------
    case
        The hybrid model, with priors of soil and effects and the noise of the sensors.
    kept_back, whole
        Rows of the runs that were kept back, and all rows.

    Returns
    -------
    ErrorScales
        `CHECKED` and the usual scales, by rising size.

    References
    ----------
    MacKay, Neural Computation 4(3), 1992 (evidence by Laplace's approximation).
    """
    rest = 1.0 - CHECKED.probability
    usual = [replace(s, probability=s.probability * rest) for s in USUAL_SCALES.scales]
    scales = [CHECKED, *usual]
    prior = np.asarray([scale.probability for scale in scales])
    own = replace(case, discrepancy={}, remainder=None, soil_tests=())
    found = [_posterior(own, rows, scales, prior) for rows in (kept_back, whole)]
    widest = min(found, key=lambda probabilities: float(probabilities[0]))
    return ErrorScales(
        tuple(replace(s, probability=float(p)) for s, p in zip(scales, widest, strict=True))
    )


def _posterior(case: Case, rows: Table, scales: Sequence[ErrorScale], prior: Floats) -> Floats:
    """Probabilities of the scales given these rows; the prior of the usual ones without a fit."""
    logs = np.log(prior) + _log_evidences(case, rows, scales)
    if not np.isfinite(logs).any():
        logs = np.log(prior)
        logs[0] = -np.inf
    weights = np.exp(logs - logs.max())
    return np.asarray((1.0 - OPEN) * weights / weights.sum() + OPEN * prior)


def _log_evidences(case: Case, rows: Table, scales: Sequence[ErrorScale]) -> Floats:
    """Logarithms (scales,) of the integrals over soil, effects and errors.

    Minus infinity where a scale leaves a significant misfit, for which the evidence, linearised in
    the errors, means nothing, and where no fit succeeds.
    """
    found = np.full(len(scales), -np.inf)
    try:
        free = select_free(case, None)
        readings = condensed(case, usable_readings(case, rows), free)
        readings, start = with_noise_of_fit(case, readings, free)
    except (FitError, InputError):
        return found
    freedom = max(readings.reading_count - len(free), 1)
    for k, scale in enumerate(scales):
        density = fit_hypothesis(BoardErrors.of(scale), case, readings, free, {}, start)
        if density is None:
            continue
        start = density.optimum.values()
        if (density.squares + readings.squares_within) / freedom <= misfit_limit(freedom):
            found[k] = density.log_evidence
    return found
